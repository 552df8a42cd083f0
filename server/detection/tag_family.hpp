#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"

struct apriltag_family;  // of libapriltag

namespace fiducap {

/// The tags of one AprilTag family: what the detector reads, the simulator draws and the printer
/// gets.
class TagFamily final {
 public:
  /// @return Error `kUnsupported` naming the known ones
  [[nodiscard]] static Expected<TagFamily> named(const std::string& name);

  /// Ids are 0 .. ids() − 1.
  [[nodiscard]] int ids() const;
  /// Modules (bits) along one side of the printed square, quiet zone or outer bits included.
  [[nodiscard]] int width() const;
  /// Modules along what is called the tag's edge, from corner to corner.
  [[nodiscard]] int edge_width() const;
  /// White inside, black outside: the border inverted, with bits around it.
  [[nodiscard]] bool has_reversed_border() const;
  /// width() × width() modules, rows from the top of the tag, 0 black or 255 white. @pre 0 <= id <
  /// ids()
  [[nodiscard]] std::vector<std::uint8_t> modules(int id) const;
  /// For libapriltag; lives as long as this.
  [[nodiscard]] apriltag_family* handle() const { return handle_.get(); }

 private:
  using Handle = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;
  explicit TagFamily(Handle handle) : handle_(std::move(handle)) {}
  Handle handle_;
};

/// `tag36h11`, `tag25h9`, `tag16h5`, …
[[nodiscard]] bool is_tag_family(const std::string& name);
/// For messages: all names, comma separated.
[[nodiscard]] std::string tag_family_names();

}  // namespace fiducap
