#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// Which tags keep contradicting the others: they are gone from their places, or were never there.
///
/// Local, held and given tags alike, by id, so that what a filter forgets and replays of its past
/// changes no score. An update that accepts no tag convicts none: the filter may be wrong itself.
/// If it was one tag all the time, and then another fits, that one was wrong.
class TagScores final {
 public:
  /// Contradictions by images that accepted no tag, before one is suspected; fewer may be one bad
  /// image.
  static constexpr int kToSuspect = 3;
  static constexpr int kToDrop = 10;  ///< Contradictions in a row before a tag is given up.

  /// @param accepted  per entry of `used`
  /// @return ids of the tags that are given up with this image; their scores start anew
  std::span<const int> count(std::span<const TagToUse> used, const std::vector<bool>& accepted);
  /// Something else was wrong.
  void clear() { scores_.clear(); }
  /// It contradicts, or the filter is wrong.
  [[nodiscard]] bool is_suspect(int tag_id) const;
  [[nodiscard]] int suspects() const;

 private:
  /// Of a tag that was rejected when it was seen last.
  struct Score {
    int tag_id{};
    int rejected_in_row{};  ///< By images that accepted other tags.
    int rejected_alone{};   ///< By images that accepted none, since one last did.
  };

  [[nodiscard]] Score& score_of(int tag_id);

  std::vector<Score> scores_;
  std::vector<int> given_up_;
};

}  // namespace fiducap
