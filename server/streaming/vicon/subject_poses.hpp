#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/validity.hpp"
#include "streaming/vicon/codec.hpp"

namespace fiducap::vicon {

/// One body of one frame as clients are to see it.
struct SubjectPose {
  bool listed{true};   ///< Stands in the list of subjects.
  bool visible{true};  ///< Has segments; a listed subject without is what clients call occluded.
  double quality{};    ///< 0 bad … 1 excellent.
  SegmentPose segment;
};

/// How good a pose is on Vicon's scale: 1 / (1 + (worst sigma / 20 mm or 20 mrad)²), 0 when it may
/// not be used.
[[nodiscard]] double quality_of(const BodyPose& body);

/// A frame's bodies in millimetres, with what the configured policy makes of invalid ones: flag –
/// occluded; stop – not even listed; hold – the last valid pose again, at quality 0.
class SubjectPoses final {
 public:
  SubjectPoses(const OutputAxes& axes, WhenInvalid when_invalid)
      : axes_(axes), when_invalid_(when_invalid) {}

  /// Fills `all`, in the order of the frame's bodies. Allocates nothing while the bodies stay the
  /// same.
  void take_over(const SceneFrame& frame);
  [[nodiscard]] const std::vector<SubjectPose>& all() const { return all_; }

 private:
  void show(const BodyPose& body, SubjectPose& out);

  AxesChange axes_;
  WhenInvalid when_invalid_;
  std::vector<SubjectPose> all_;
  std::uint64_t axes_number_{0};  ///< Of the last frame: nothing is held beyond an alignment.
  std::unordered_map<int, SegmentPose> held_;  ///< By body; only for hold.
};

}  // namespace fiducap::vicon
