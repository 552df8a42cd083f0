#include "app/guided_search.hpp"

#include <algorithm>

namespace fiducap {

namespace {
constexpr Duration kExtrinsicsPeriod =
    std::chrono::seconds(1);  // they move slowly, and asking for them allocates
}  // namespace

GuidedSearch::GuidedSearch(const BodySensors& sensors, const TagSetConfig& tags,
                           const DetectorConfig& detector, const EstimatorConfig& estimator)
    : regions_(detector.regions), search_(tags, detector), forecast_(sensors, estimator) {}

void GuidedSearch::add_imu(const ImuSample& imu) {
  if (regions_) forecast_.add_imu(imu);
}

const CornerFrame& GuidedSearch::search(const CameraFrame& frame, std::span<const TagBelief> local,
                                        const TagMap& map) {
  expected_.clear();
  const bool aimed = regions_ && forecast_.aim(frame.camera, frame.exposed_at);
  if (aimed) expect(local, map);
  const CornerFrame& found = search_.search(frame, expected_);
  if (aimed) forecast_.learn(expected_, found);
  return found;
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

void GuidedSearch::corrected(const BodyFilter& filter,
                             const std::optional<BodyEstimate>& estimate) {
  if (!regions_) return;
  if (!estimate) return forecast_.clear();
  forecast_.set_estimate(*estimate);
  if (extrinsics_at_ && estimate->at >= *extrinsics_at_ &&
      estimate->at - *extrinsics_at_ < kExtrinsicsPeriod)
    return;
  extrinsics_at_ = estimate->at;
  const auto extrinsics = filter.extrinsics();
  for (std::size_t k = 0; k < extrinsics.size(); ++k)
    forecast_.set_extrinsics(k, extrinsics[k].X_BV);
}

}  // namespace fiducap
