#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "estimation/conversation/tag_scores.hpp"

namespace fiducap {

/// What the images say against the filter, and against single tags.
class Contradictions final {
 public:
  /// Takes in what an update made of its tags.
  /// @return ids of the tags to give up
  std::span<const int> count(int camera, Instant exposed_at, std::span<const TagToUse> used,
                             const std::vector<bool>& accepted);
  /// Something gave a pose, or was believed.
  void note_fit(Instant at) { last_fit_ = at; }
  /// Something else was wrong: the motion …
  void pardon();
  /// … or a clock; how many images contradict in a row stays counted.
  void pardon_tags() { scores_.clear(); }
  void forget_all() { *this = Contradictions{}; }

  /// Images in a row with tags to use, and none accepted …
  [[nodiscard]] int images_without_fit() const { return images_without_fit_; }
  /// … and with at least half of them not accepted.
  [[nodiscard]] int contradicting_images() const { return contradicting_images_; }
  /// … of one camera.
  [[nodiscard]] int contradicting_images_of(int camera) const {
    const auto k = static_cast<std::size_t>(camera);
    return k < contradicting_of_.size() ? contradicting_of_[k] : 0;
  }
  [[nodiscard]] double seconds_without_fit(Instant now) const {
    return last_fit_ ? to_seconds(now - *last_fit_) : 0.0;
  }
  [[nodiscard]] bool has_ever_fit() const { return last_fit_.has_value(); }
  [[nodiscard]] const TagScores& scores() const { return scores_; }

 private:
  TagScores scores_;
  std::optional<Instant> last_fit_;
  int images_without_fit_{0};
  int contradicting_images_{0};
  std::vector<int> contradicting_of_;  ///< Per camera that was counted so far.
};

}  // namespace fiducap
