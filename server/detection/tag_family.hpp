#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

struct apriltag_family;  // of libapriltag

namespace fiducap {

/// Properties of a tag family. docs/design/tag-families.md has the table.
struct TagFamilyFacts {
  std::string_view name;  ///< As configurations, recordings and maps write it.
  int edge_cells;         ///< Along the edge that `size_m` measures, from corner to corner.
  /// Largest number of bits to correct: more would decode false tags, or need too much memory for
  /// the table of near codes.
  int max_corrected_bits;
  /// Decision margin below which false tags are frequent; 0: the detector's limit is enough.
  double min_margin;
  bool is_weak;    ///< False tags and confused ids occur even so.
  int dictionary;  ///< Number of OpenCV's ArUco dictionary; −1: the family is libapriltag's.
};

/// All families that can be printed and detected.
[[nodiscard]] std::span<const TagFamilyFacts> tag_families();

/// Ignores case, `-`, `_` and blanks. `4x4_50` and `aruco_4x4_50` are `DICT_4X4_50`; `36h11`,
/// `AprilTag 36h11`, `kTag36h11`, `tf36h11`, `apriltag3_36h11_classic` are `tag36h11`. Allocates
/// nothing for a name as listed.
/// @return nullptr for an unknown one
[[nodiscard]] const TagFamilyFacts* find_tag_family(std::string_view name);

[[nodiscard]] inline bool is_tag_family(std::string_view name) {
  return find_tag_family(name) != nullptr;
}
/// The name as listed, so that names can be compared; unknown ones are returned unchanged.
[[nodiscard]] std::string listed_tag_family(std::string name);

/// For messages: all names, comma separated.
[[nodiscard]] std::string tag_family_names();
/// For messages: `must be one of …`, with the most similar name.
[[nodiscard]] std::string tag_family_rule(std::string_view name);
/// Why another family would be better; empty for a good one.
[[nodiscard]] std::string tag_family_warning(std::string_view name);

/// The tags of one family, for detector, simulator and printer. An ArUco dictionary is converted to
/// libapriltag's order of bits, so that the same detector finds its tags.
class TagFamily final {
 public:
  /// @return Error `kUnsupported` naming the known ones
  [[nodiscard]] static Expected<TagFamily> named(const std::string& name);

  [[nodiscard]] const TagFamilyFacts& facts() const { return *facts_; }
  /// Ids are 0 .. ids() − 1.
  [[nodiscard]] int ids() const;
  /// False for a print with rotational symmetry: it shows no pose and is not detected.
  [[nodiscard]] bool has_pose(int id) const;
  /// Why there is no such tag, for messages; empty for one that can be printed and detected.
  [[nodiscard]] std::string fault_of(int id) const;
  /// Cells along one side of the printed square, quiet zone or outer bits included.
  [[nodiscard]] int width() const;
  /// Cells along the tag's edge, from corner to corner.
  [[nodiscard]] int edge_width() const;
  /// White border inside a black one, with bits around it.
  [[nodiscard]] bool has_reversed_border() const;
  /// width() × width() cells, rows from the top of the tag, 0 black or 255 white.
  /// @pre 0 <= id < ids() && has_pose(id)
  [[nodiscard]] std::vector<std::uint8_t> cells(int id) const;
  /// For libapriltag; lives as long as this object.
  [[nodiscard]] apriltag_family* handle() const { return handle_.get(); }

 private:
  using Handle = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;
  TagFamily(const TagFamilyFacts& facts, Handle handle)
      : facts_(&facts), handle_(std::move(handle)) {}

  const TagFamilyFacts* facts_;
  Handle handle_;
};

}  // namespace fiducap
