#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "estimation/found_mismatch.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// How the errors of two tags hang together: covariance of the first's six numbers with the
/// second's, as KnownTag::covariance. first_id < second_id.
struct KnownPair {
  int first_id{};
  int second_id{};
  Matrix6d covariance{Matrix6d::Zero()};
};

/// All tags of the map with a place in the workspace. Tags of one map share most of their error
/// (place and heading of the whole, bends of a chain): of those that were seen together it is said
/// how much.
struct KnownMap {
  std::uint64_t revision{};      ///< Another number: something may have changed.
  std::vector<KnownTag> tags;    ///< Sorted by id.
  std::vector<KnownPair> pairs;  ///< Sorted by both ids.
  /// Found to be of another size than told; kAllPrints: all of them. Places are right all the same.
  std::vector<int> wrong_prints;
  static constexpr int kAllPrints = -1;
  /// Lenses that are other ones than configured: what about them.
  struct WrongLens {
    int body_id{};
    int camera{};
    FoundMismatch::Kind kind{};
  };
  std::vector<WrongLens> wrong_lenses;
  /// Lenses, readouts and prints were doubted by what all bodies saw, and what is not named here
  /// was found to be as configured. False: nobody has asked.
  bool is_judged{false};

  [[nodiscard]] const KnownTag* find(int tag_id) const {
    const auto at = std::lower_bound(tags.begin(), tags.end(), tag_id,
                                     [](const KnownTag& tag, int id) { return tag.tag_id < id; });
    return at != tags.end() && at->tag_id == tag_id ? &*at : nullptr;
  }
  /// Covariance of one tag's numbers (rows) with another's; nullopt: not known.
  [[nodiscard]] std::optional<Matrix6d> between(int row_id, int column_id) const {
    if (row_id > column_id) {
      const auto turned = between(column_id, row_id);
      return turned ? std::optional<Matrix6d>(turned->transpose()) : std::nullopt;
    }
    const auto key = std::pair(row_id, column_id);
    const auto at = std::lower_bound(pairs.begin(), pairs.end(), key,
                                     [](const KnownPair& pair, const std::pair<int, int>& ids) {
                                       return std::pair(pair.first_id, pair.second_id) < ids;
                                     });
    if (at == pairs.end() || std::pair(at->first_id, at->second_id) != key) return std::nullopt;
    return at->covariance;
  }
};

}  // namespace fiducap
