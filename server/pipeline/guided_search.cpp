#include "pipeline/guided_search.hpp"

#include <algorithm>

namespace fiducap {

GuidedSearch::GuidedSearch(const BodySensors& sensors, const TagSetConfig& tags,
                           const DetectorConfig& detector, const EstimatorConfig& estimator)
    : regions_(detector.regions), search_(tags, detector), forecast_(sensors, estimator) {
  for (const CameraMount& camera : sensors.cameras) models_.push_back(camera.model);
  if (estimator.landmarks && sensors.imu) points_.emplace(sensors.cameras.size());
}

void GuidedSearch::add_imu(const ImuSample& imu) {
  if (regions_ || points_) forecast_.add_imu(imu);
}

const CornerFrame& GuidedSearch::search(const CameraFrame& frame, std::span<const TagBelief> local,
                                        const TagMap& map) {
  expected_.clear();
  const bool aimed = (regions_ || points_) && forecast_.aim(frame.camera, frame.exposed_at);
  if (aimed && regions_) expect(local, map);
  const CornerFrame& found = search_.search(frame, expected_);
  if (aimed && regions_) forecast_.learn(expected_, found);
  return points_ ? with_points(frame, found, aimed) : found;
}

const CornerFrame& GuidedSearch::with_points(const CameraFrame& frame, const CornerFrame& found,
                                             bool aimed) {
  with_points_ = found;
  if (frame.camera < 0 || static_cast<std::size_t>(frame.camera) >= models_.size())
    return with_points_;
  const auto points =
      points_->follow(frame, models_[static_cast<std::size_t>(frame.camera)],
                      aimed ? std::optional(forecast_.q_WV()) : std::nullopt, found.tags);
  with_points_.points.assign(points.begin(), points.end());
  return with_points_;
}

std::optional<PointStatistics> GuidedSearch::points() const {
  return points_ ? std::optional(points_->statistics()) : std::nullopt;
}

void GuidedSearch::expect(std::span<const TagBelief> local, const TagMap& map) {
  local_ids_.clear();
  for (const TagBelief& belief : local) {
    local_ids_.push_back(belief.tag.tag_id);
    forecast_.expect(belief.tag, expected_);
  }
  std::sort(local_ids_.begin(), local_ids_.end());
  for (const MapTag& entry : map.tags) {
    if (entry.state == TagState::kQuarantined || entry.component != 0) continue;
    if (std::binary_search(local_ids_.begin(), local_ids_.end(), entry.tag.tag_id)) continue;
    forecast_.expect(entry.tag, expected_);
  }
  forecast_.expect_strangers(expected_);
}

void GuidedSearch::learn(const std::optional<BodyEstimate>& estimate,
                         std::span<const ExtrinsicsEstimate> cameras) {
  if (!regions_ && !points_) return;
  if (!estimate) return forecast_.clear();
  forecast_.set_estimate(*estimate);
  if (points_ && estimate->at == with_points_.exposed_at &&
      forecast_.aim(with_points_.camera, estimate->at)) {
    points_->corrected(with_points_.camera, forecast_.q_WV());
  }
  for (std::size_t k = 0; k < cameras.size(); ++k) forecast_.set_camera(k, cameras[k]);
}

}  // namespace fiducap
