#pragma once

#include <cstddef>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/expected.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// Larger texts are refused before they are parsed; 100 000 tags with covariance need less.
inline constexpr std::size_t kLongestMapText = std::size_t{64} << 20;

[[nodiscard]] Expected<void> check_length(const std::string& text, const std::string& context);

/// Makes a quaternion that its writer rounded unit again; one that is unit to the last digits stays
/// as it is.
void restore_unit(Pose& pose);

/// The tags of a text, in whatever order it has them.
class ImportedTags final {
 public:
  /// Adds one tag, its quaternion unit again.
  /// @param context  where the tag stands, for the message
  /// @return Error when the tag is broken or its id is there already, with both places
  [[nodiscard]] Expected<void> add(MapTag entry, const std::string& context);
  /// Sorted by id.
  [[nodiscard]] std::vector<MapTag> take();

 private:
  std::vector<MapTag> tags_;
  std::unordered_map<int, std::string> places_;  ///< By id.
};

}  // namespace fiducap
