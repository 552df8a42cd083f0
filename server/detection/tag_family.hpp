#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "detection/tag_family_list.hpp"

struct apriltag_family;  // of libapriltag

namespace fiducap {

/// The tags of one family: what the detector reads, the simulator draws and the printer gets. An
/// ArUco dictionary is one, too: its codes in libapriltag's order of bits, so that its tags are
/// found by the same quads, and their corners by the same fit.
class TagFamily final {
 public:
  /// @return Error `kUnsupported` naming the known ones
  [[nodiscard]] static Expected<TagFamily> named(const std::string& name);

  [[nodiscard]] const TagFamilyFacts& facts() const { return *facts_; }
  /// Ids are 0 .. ids() − 1.
  [[nodiscard]] int ids() const;
  /// A print that looks the same when it is turned shows no pose: it is not read.
  [[nodiscard]] bool has_pose(int id) const;
  /// Why there is no such tag, in words; empty for one that can be printed and read.
  [[nodiscard]] std::string fault_of(int id) const;
  /// Modules (bits) along one side of the printed square, quiet zone or outer bits included.
  [[nodiscard]] int width() const;
  /// Modules along what is called the tag's edge, from corner to corner.
  [[nodiscard]] int edge_width() const;
  /// White inside, black outside: the border inverted, with bits around it.
  [[nodiscard]] bool has_reversed_border() const;
  /// width() × width() modules, rows from the top of the tag, 0 black or 255 white.
  /// @pre 0 <= id < ids() && has_pose(id)
  [[nodiscard]] std::vector<std::uint8_t> modules(int id) const;
  /// For libapriltag; lives as long as this.
  [[nodiscard]] apriltag_family* handle() const { return handle_.get(); }

 private:
  using Handle = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;
  TagFamily(const TagFamilyFacts& facts, Handle handle)
      : facts_(&facts), handle_(std::move(handle)) {}
  static Handle make(const TagFamilyFacts& facts);

  const TagFamilyFacts* facts_;
  Handle handle_;
};

}  // namespace fiducap
