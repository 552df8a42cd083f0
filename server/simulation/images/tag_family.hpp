#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"

struct apriltag_family;

namespace fiducap::simulation {

/// What the tags of one AprilTag family look like on paper.
class TagFamily final {
 public:
  [[nodiscard]] static Expected<TagFamily> named(const std::string& name);
  [[nodiscard]] static const std::vector<std::string>& names();

  /// Ids are 0 .. ids() − 1.
  [[nodiscard]] int ids() const;
  /// Modules (bits) along one side of the printed square, white border included.
  [[nodiscard]] int width() const;
  /// Modules along what is called the tag's edge, from corner to corner.
  [[nodiscard]] int edge_width() const;
  /// width() × width() modules, rows from the top of the tag, 0 black or 255 white. @pre 0 <= id <
  /// ids()
  [[nodiscard]] std::vector<std::uint8_t> modules(int id) const;

 private:
  using Handle = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;
  explicit TagFamily(Handle handle) : handle_(std::move(handle)) {}
  Handle handle_;
};

}  // namespace fiducap::simulation
