#pragma once

#include <cstdint>
#include <optional>

#include "scene/scene_frame.hpp"
#include "streaming/qualisys/command.hpp"

namespace fiducap::qualisys {

/// Chooses the frames of one client's stream: all, every n-th, or about n per second.
class FramePicker final {
 public:
  explicit FramePicker(Rate rate) : rate_(rate) {}

  /// Ask once per frame.
  [[nodiscard]] bool wants(const SceneFrame& frame);

 private:
  Rate rate_;
  std::optional<std::uint64_t> first_;
  std::optional<Instant> due_;
};

}  // namespace fiducap::qualisys
