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

/// An image with noises as the filter has learned them.
[[nodiscard]] SegmentImage segment_image(const TagObservations& seen, const BodyFilter& filter,
                                         const EstimatorConfig& config);
/// Cameras as the filter has learned them.
[[nodiscard]] std::vector<CameraBelief> camera_beliefs(const BodyFilter& filter,
                                                       std::span<const CameraMount> mounts);

/// Cuts what one body sees and feels into segments for the map graph.
///
/// A segment ends about a second after it began, at an image with a tag. A chain of them ends when
/// the filter forgets or loses the body. While a start may be taken back its segments are held
/// back; when it is, those of the start that has won take their place. Images without a tag that
/// the filter or the map has a place for are left out, their readings are not. Nothing of the
/// filter's covariance enters: the graph gets every reading and every corner once.
class SegmentRecorder final : public FilterWitness {
 public:
  /// @param holds_every_image  also those without a tag are instances
  SegmentRecorder(const BodySensors& sensors, const EstimatorConfig& config,
                  bool holds_every_image = false);

  void add(const ImuSample& imu) override;
  void add(const TagObservations& seen, BodyFilter& filter, const UpdateReport& report,
           std::span<const TagBelief> beliefs, std::span<const KnownTag> known) override;
  [[nodiscard]] std::unique_ptr<FilterWitness> afresh() const override {
    return std::make_unique<SegmentRecorder>(sensors_, config_, holds_every_image_);
  }
  /// The motion was lost, or the estimate is not believed: what comes next hangs on nothing.
  void break_chain();
  /// Nothing more will come: what is open ends at its last image.
  void finish(const BodyFilter& filter);
  /// A segment that has ended, the oldest one first; nullptr: none.
  [[nodiscard]] std::shared_ptr<const MotionSegment> take();

 private:
  void go_on_from(SegmentRecorder start, const UpdateReport& report);
  void begin(const BodyEstimate& body);
  void integrate_to(Instant to, double imu_variance);
  void add_step(Instant to, const InertialInput& input, Duration longest);
  [[nodiscard]] bool has_place(int tag_id) const { return places_.contains(tag_id); }
  void shift_axes(const Pose& X_new_old);
  void end(const BodyFilter& filter);

  BodySensors sensors_;
  EstimatorConfig config_;
  bool holds_every_image_;
  ImuBuffer imu_;
  MotionSegment open_;
  bool is_open_{false};
  Instant reached_{};                ///< Readings are in the steps up to here.
  Instant of_use_at_{};              ///< The last image with a tag that had a place.
  std::vector<SegmentStep> steps_;   ///< Since the last instance.
  std::map<int, KnownTag> places_;   ///< Of the tags seen since the segment began.
  std::vector<TagBelief> own_tags_;  ///< Kept for its memory.
  int chain_{0};
  int generation_{-1};
  std::deque<std::shared_ptr<const MotionSegment>> done_;
  bool start_is_open_{false};
};

}  // namespace fiducap
