#pragma once

#include <deque>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "capture/imu_sample.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/imu/imu_buffer.hpp"
#include "estimation/segment/motion_segment.hpp"

namespace fiducap {

/// An image with the filter's learned noise.
[[nodiscard]] SegmentImage segment_image(const TagObservations& seen, const BodyFilter& filter,
                                         const EstimatorConfig& config);
/// Cameras as estimated by the filter.
[[nodiscard]] std::vector<CameraBelief> camera_beliefs(const BodyFilter& filter,
                                                       std::span<const CameraMount> mounts);

/// Cuts the measurements of one body into segments for the map graph.
///
/// A segment ends about a second after it began, at an image with a tag. A chain ends when the
/// filter restarts or loses the body. While a start may be replaced its segments are held back;
/// those of the selected start replace them. Images without a tag known to filter or map are
/// dropped, their IMU samples are not. The filter's covariance is not used: the graph gets every
/// measurement once.
class SegmentRecorder final : public FilterObserver {
 public:
  /// @param holds_every_image  also images without a tag are instances
  SegmentRecorder(const BodySensors& sensors, const EstimatorConfig& config,
                  bool holds_every_image = false);

  void add(const ImuSample& imu) override;
  void add(const TagObservations& seen, BodyFilter& filter, const UpdateReport& report,
           std::span<const TagBelief> beliefs, std::span<const KnownTag> known) override;
  [[nodiscard]] std::unique_ptr<FilterObserver> make_new() const override {
    return std::make_unique<SegmentRecorder>(sensors_, config_, holds_every_image_);
  }
  /// Ends the chain: the motion was lost or the estimate is wrong.
  void break_chain();
  /// Ends the open segment at its last image.
  void finish(const BodyFilter& filter);
  /// The oldest ended segment; nullptr: none.
  [[nodiscard]] std::shared_ptr<const MotionSegment> take();

 private:
  void begin(const BodyEstimate& body);
  void integrate_to(Instant to, double imu_variance);
  void add_step(Instant to, const InertialInput& input, Duration longest);
  void shift_axes(const Pose& X_new_old);
  void end(const BodyFilter& filter);

  BodySensors sensors_;
  EstimatorConfig config_;
  bool holds_every_image_;
  ImuBuffer imu_;
  MotionSegment open_;
  bool is_open_{false};
  Instant reached_{};                ///< End of the steps.
  Instant of_use_at_{};              ///< Last image with a known tag.
  std::vector<SegmentStep> steps_;   ///< Since the last instance.
  std::map<int, KnownTag> places_;   ///< Of the tags seen since the segment began.
  std::vector<TagBelief> own_tags_;  ///< Scratch.
  int chain_{0};
  int generation_{-1};
  std::deque<std::shared_ptr<const MotionSegment>> done_;
  bool start_is_open_{false};
};

}  // namespace fiducap
