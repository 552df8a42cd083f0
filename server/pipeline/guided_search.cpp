#include "pipeline/guided_search.hpp"

#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "base/numeric.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {
namespace {

constexpr double kNearest_m = 0.02;
constexpr double kLeastCosTilt = 0.12;   // 83° off its normal; detectors give up earlier
constexpr double kLeastWidth_px = 8.0;   // between opposite sides; a bit is then one pixel
constexpr double kFirstError_px = 10.0;  // before the first comparison
constexpr double kLeastSigma_px = 1.0;
constexpr double kForget = 0.9;  // per image
// Motion of an unforecast tag between two images by translation, 1-sigma in sides of the tag: 1
// m/s, 20 Hz, 0.3 m.
constexpr double kUnforecast = 0.15;
constexpr double kMostError = 0.1;       // of the image's width
constexpr double kMostUnseen_px = 15.0;  // for tags that were not in the last image

double mean_var(const Matrix15d& P, int block) {
  return P.diagonal().segment<3>(block).sum() / 3.0;
}

}  // namespace

TagForecast::TagForecast(const BodySensors& sensors, const EstimatorConfig& config)
    : predictor_(sensors, config) {
  for (const CameraMount& mount : sensors.cameras)
    cameras_.push_back({mount, mount.model, kFirstError_px, {}, {}, Pose{}});
}

void TagForecast::set_estimate(const BodyEstimate& estimate) {
  if (!estimate.anchored) return clear();
  base_ = estimate;
  predictor_.set_estimate(estimate);
}

void TagForecast::clear() {
  base_.reset();
  predictor_.clear();
}

bool TagForecast::aim(int camera, Instant at) {
  aimed_ = nullptr;
  if (!base_ || camera < 0 || camera >= static_cast<int>(cameras_.size())) return false;
  const auto body = predictor_.predict(at);
  if (!body || !body->X_WB.p.allFinite() || !body->X_WB.q.coeffs().allFinite()) return false;
  using namespace estimate_block;
  aimed_ = &cameras_[static_cast<std::size_t>(camera)];
  X_VW_ = (body->X_WB * aimed_->mount.X_BV).inverse();
  body_position_var_ = mean_var(body->covariance, kPosition);
  body_rotation_var_ = mean_var(body->covariance, kAttitude);
  grown_position_var_ = std::max(0.0, body_position_var_ - mean_var(base_->covariance, kPosition));
  grown_rotation_var_ = std::max(0.0, body_rotation_var_ - mean_var(base_->covariance, kAttitude));
  return true;
}

void TagForecast::expect(const KnownTag& tag, std::vector<ExpectedTag>& out) const {
  FIDUCAP_ASSERT(aimed_ != nullptr);
  const Eigen::Vector3d p_VT = X_VW_ * tag.X_WT.p;
  if (!(p_VT.z() > kNearest_m)) return;
  const Eigen::Quaterniond q_VT = X_VW_.q * tag.X_WT.q;
  const Eigen::Vector3d normal = q_VT * Eigen::Vector3d::UnitZ();
  if (!(-normal.dot(p_VT) > kLeastCosTilt * p_VT.norm())) return;
  const CameraModel& model = aimed_->mount.model;
  ExpectedTag expected{tag.tag_id, {}, sigma_px(tag, p_VT.z())};
  const double away = 3 * expected.sigma_px;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto px = model.project(p_VT + q_VT * tag_corner(static_cast<int>(i), tag.edge_m));
    if (!px || px->x() < -away || px->y() < -away || px->x() > model.width + away ||
        px->y() > model.height + away) {
      return;
    }
    expected.corners_px[i] = *px;
  }
  if (outline_of(expected.corners_px).width_px >= kLeastWidth_px) out.push_back(expected);
}

double TagForecast::sigma_px(const KnownTag& tag, double depth_m) const {
  const double f = aimed_->mount.model.fu;
  const auto pixels_var = [&](double position_var, double rotation_var) {
    return f * f * (position_var / (depth_m * depth_m) + rotation_var);
  };
  double var =
      aimed_->error_px * aimed_->error_px + pixels_var(grown_position_var_, grown_rotation_var_);
  if (!was_seen(tag.tag_id)) {
    const double tag_var = std::max(0.0, tag.covariance.diagonal().head<3>().sum() / 3.0);
    var += std::min(kMostUnseen_px * kMostUnseen_px,
                    pixels_var(body_position_var_ + tag_var, body_rotation_var_));
  }
  return std::max(kLeastSigma_px, std::sqrt(var));
}

void TagForecast::expect_unforecast(std::vector<ExpectedTag>& out) const {
  FIDUCAP_ASSERT(aimed_ != nullptr);
  const CameraModel& model = aimed_->mount.model;
  const Eigen::Quaterniond q_VU = X_VW_.q * aimed_->X_VW.q.conjugate();  // U: the camera then
  for (const TagSighting& tag : aimed_->unforecast) {
    ExpectedTag expected{tag.tag_id, {}, 0, false};
    bool in_lens = true;
    for (std::size_t i = 0; i < 4 && in_lens; ++i) {
      const auto ideal = undistort(model, tag.corners_px[i]);
      if (!(in_lens = ideal.has_value())) break;
      const Eigen::Vector3d ray((ideal->px.x() - model.cu) / model.fu,
                                (ideal->px.y() - model.cv) / model.fv, 1);
      const auto px = model.project(q_VU * ray);
      if (!(in_lens = px.has_value())) break;
      expected.corners_px[i] = *px;
    }
    if (!in_lens) continue;
    expected.sigma_px =
        std::hypot(aimed_->error_px, kUnforecast * outline_of(expected.corners_px).longest_px);
    out.push_back(expected);
  }
}

bool TagForecast::was_seen(int tag_id) const {
  return std::binary_search(aimed_->seen.begin(), aimed_->seen.end(), tag_id);
}

void TagForecast::learn(const std::vector<ExpectedTag>& expected, const CornerFrame& found) {
  if (aimed_ == nullptr) return;
  errors_px_.clear();
  for (const ExpectedTag& tag : expected) {
    if (!tag.known || !was_seen(tag.tag_id))
      continue;  // its error is the map's, not the prediction's
    const auto seen = std::ranges::find(found.tags, tag.tag_id, &TagSighting::tag_id);
    if (seen == found.tags.end()) continue;
    Eigen::Vector2d off = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < 4; ++i) off += 0.25 * (seen->corners_px[i] - tag.corners_px[i]);
    errors_px_.push_back(off.norm());
  }
  aimed_->error_px *= kForget;
  if (!errors_px_.empty())
    aimed_->error_px = std::clamp(nth_smallest(errors_px_, errors_px_.size() / 2), aimed_->error_px,
                                  kMostError * aimed_->mount.model.width);
  aimed_->seen.clear();
  aimed_->unforecast.clear();
  aimed_->X_VW = X_VW_;
  for (const TagSighting& tag : found.tags) {
    aimed_->seen.push_back(tag.tag_id);
    const bool is_forecast = std::ranges::any_of(
        expected, [&](const ExpectedTag& e) { return e.tag_id == tag.tag_id && e.known; });
    if (!is_forecast) aimed_->unforecast.push_back(tag);
  }
}

GuidedSearch::GuidedSearch(const BodySensors& sensors, const TagSetConfig& tags,
                           const DetectorConfig& detector, const EstimatorConfig& estimator)
    : regions_(detector.regions), search_(tags, detector), forecast_(sensors, estimator) {
  for (const CameraMount& camera : sensors.cameras) models_.push_back(camera.model);
  if (estimator.landmarks && sensors.imu) points_.resize(sensors.cameras.size());
}

void GuidedSearch::add_imu(const ImuSample& imu) {
  if (regions_ || !points_.empty()) forecast_.add_imu(imu);
}

const CornerFrame& GuidedSearch::search(const CameraFrame& frame, std::span<const TagBelief> local,
                                        const TagMap& map) {
  expected_.clear();
  const bool aimed =
      (regions_ || !points_.empty()) && forecast_.aim(frame.camera, frame.exposed_at);
  if (aimed && regions_) expect(local, map);
  const CornerFrame& found = search_.search(frame, expected_);
  if (aimed && regions_) forecast_.learn(expected_, found);
  return points_.empty() ? found : with_points(frame, found, aimed);
}

const CornerFrame& GuidedSearch::with_points(const CameraFrame& frame, const CornerFrame& found,
                                             bool aimed) {
  with_points_ = found;
  if (frame.camera < 0 || static_cast<std::size_t>(frame.camera) >= models_.size())
    return with_points_;
  const auto number = static_cast<std::size_t>(frame.camera);
  PointCamera& camera = points_[number];
  const auto q_WV = aimed ? std::optional(forecast_.q_WV()) : std::nullopt;
  std::optional<Eigen::Quaterniond> q_beforeNow;
  if (q_WV && camera.q_WV) q_beforeNow = camera.q_WV->conjugate() * *q_WV;
  camera.q_WV = q_WV;
  const auto points = camera.tracker.follow(frame, models_[number], q_beforeNow, found.tags);
  with_points_.points.assign(points.begin(), points.end());
  return with_points_;
}

void GuidedSearch::expect(std::span<const TagBelief> local, const TagMap& map) {
  local_ids_.clear();
  for (const TagBelief& belief : local) {
    local_ids_.push_back(belief.tag.tag_id);
    forecast_.expect(belief.tag, expected_);
  }
  std::ranges::sort(local_ids_);
  for (const MapTag& entry : map.tags) {
    if (entry.state == TagState::kQuarantined || entry.component != 0) continue;
    if (std::binary_search(local_ids_.begin(), local_ids_.end(), entry.tag.tag_id)) continue;
    forecast_.expect(entry.tag, expected_);
  }
  forecast_.expect_unforecast(expected_);
}

void GuidedSearch::learn(const std::optional<BodyEstimate>& estimate,
                         std::span<const ExtrinsicsEstimate> cameras) {
  if (!regions_ && points_.empty()) return;
  if (!estimate) return forecast_.clear();
  forecast_.set_estimate(*estimate);
  if (!points_.empty() && estimate->at == with_points_.exposed_at &&
      forecast_.aim(with_points_.camera, estimate->at))
    points_[static_cast<std::size_t>(with_points_.camera)].q_WV = forecast_.q_WV();
  for (std::size_t k = 0; k < cameras.size(); ++k) forecast_.set_camera(k, cameras[k]);
}

}  // namespace fiducap
