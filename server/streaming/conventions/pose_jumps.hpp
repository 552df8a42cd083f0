#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene_frame.hpp"

namespace fiducap {

/// Counts per body how often its pose moved in a way no motion explains: it came back after it was
/// gone, the map moved at once, or an operator aligned it (by however little). What the map
/// corrects little by little (CorrectionRamp) is none: nobody has to start again for less than a
/// sigma. Who fuses the stream starts again then. One `observe` per frame; allocates nothing while
/// the bodies are the same.
class PoseJumps final {
 public:
  void observe(const SceneFrame& frame);
  /// @param place  in frame.bodies
  [[nodiscard]] std::uint32_t count(std::size_t place) const {
    return place < bodies_.size() ? bodies_[place].count : 0;
  }

 private:
  struct Seen {
    int body_id{};
    bool ever{false};
    bool valid{false};
    Instant at{};
    std::uint64_t axes{};
    Pose X_WP{};
    std::uint32_t count{0};
  };
  [[nodiscard]] static bool is_jump(const Seen& before, const BodyPose& now, Instant at);

  std::vector<Seen> bodies_;
};

}  // namespace fiducap
