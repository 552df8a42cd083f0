#pragma once

#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "base/text.hpp"
#include "mapping/formats/map_format.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

// --- numbers ---

/// As few digits as read back as the same number, with a decimal point: YAML 1.1 (ROS, PyYAML)
/// takes `1` for a whole number and `1e-05` for a word.
[[nodiscard]] std::string to_point_text(double value);
/// `x: 1.0, y: 2.5`, of such numbers. @pre as many names as values
[[nodiscard]] std::string yaml_fields(std::initializer_list<const char*> names,
                                      std::initializer_list<double> values,
                                      const std::string& between = ", ");

/// The whole text as a number; no spaces, no locale, no nan, no inf.
template <typename T>
[[nodiscard]] std::optional<T> number_from(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  T value{};
  if (!parse_number(text, value) || !std::isfinite(value)) return std::nullopt;
  return value;
}

// --- reading ---

/// Larger texts are refused before they are parsed; 100 000 tags with covariance need less.
inline constexpr std::size_t kLongestMapText = std::size_t{64} << 20;

[[nodiscard]] Expected<void> check_length(const std::string& text, const std::string& context);

/// Normalises a quaternion that was rounded; one that is unit to the last digits stays as it is.
void restore_unit(Pose& pose);

/// The tags of a text, in any order.
class ImportedTags final {
 public:
  /// Adds one tag, its quaternion normalised.
  /// @param context  place of the tag in the text, for the message
  /// @return Error when the tag is broken or its id is there already, with both places
  [[nodiscard]] Expected<void> add(MapTag entry, const std::string& context);
  /// Sorted by id.
  [[nodiscard]] std::vector<MapTag> take();

 private:
  struct Placed {
    MapTag entry;
    std::string context;
  };
  std::map<int, Placed> tags_;  ///< By id.
};

/// Completes `imported.map.family`, the file's or empty, by the options, else by tag36h11, with a
/// remark.
/// @return Error when options and file contradict each other, or the file's is not supported and
/// none is given
[[nodiscard]] Expected<ImportedMap> with_family(ImportedMap imported,
                                                const MapImportOptions& options,
                                                const std::string& context);
/// The same, with plausibility_remarks(). @return Error also for values that cannot be in metres
/// and for tags that cover each other
[[nodiscard]] Expected<ImportedMap> checked_import(ImportedMap imported,
                                                   const MapImportOptions& options,
                                                   const std::string& context);

/// Values that cannot be in metres: an edge beyond 10 m or below 1 mm, a place beyond 1000 km.
/// @return e.g. `edge is 160 m: …`; nullopt: they can
[[nodiscard]] std::optional<std::string> unit_fault_of_edge(double edge_m);
[[nodiscard]] std::optional<std::string> unit_fault_of_place(const Eigen::Vector3d& p_WT);

/// Signs that a map of another program has another convention: all tags below the floor, all upside
/// down, far from the origin. One sentence each; empty for a usual map.
[[nodiscard]] std::vector<std::string> plausibility_remarks(const TagMap& map);

// --- writing ---

/// `tags 3, 4 and 7`; after ten of them only the number of the others.
[[nodiscard]] std::string tags_text(const std::vector<int>& ids);

/// What a format of another program can contain beside ids and poses.
struct Keeps {
  bool sizes{true};
  bool sigmas{false};
  bool alignment{false};  ///< Of the workspace to the room.
};

/// The usable tags of a map. Remarked: the others, and what the format loses.
[[nodiscard]] std::vector<const MapTag*> tags_to_export(const TagMap& map, Keeps keeps,
                                                        std::vector<std::string>& remarks);

}  // namespace fiducap
