#include "pipeline/tag_forecast.hpp"

#include <algorithm>
#include <cmath>

#include "base/assert.hpp"
#include "detection/corner_projection.hpp"
#include "detection/tag_outline.hpp"

namespace fiducap {

namespace {

constexpr double kNearest_m = 0.02;
constexpr double kLeastCosTilt = 0.12;   // 83° off its normal; detectors give up earlier
constexpr double kLeastWidth_px = 8.0;   // between opposite sides; a bit is then one pixel
constexpr double kFirstError_px = 10.0;  // before anything was learned
constexpr double kLeastSigma_px = 1.0;
constexpr double kForget = 0.9;  // per image
// How far translation moves a stranger between two images, 1-sigma in sides of the tag: 1 m/s, 20
// Hz, 0.3 m.
constexpr double kStranger = 0.15;
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

void TagForecast::expect_strangers(std::vector<ExpectedTag>& out) const {
  FIDUCAP_ASSERT(aimed_ != nullptr);
  const CameraModel& model = aimed_->mount.model;
  const Eigen::Quaterniond q_VU = X_VW_.q * aimed_->X_VW.q.conjugate();  // U: the camera then
  for (const TagSighting& tag : aimed_->strangers) {
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
        std::hypot(aimed_->error_px, kStranger * outline_of(expected.corners_px).longest_px);
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
      continue;  // says more about the map than about the next image
    const auto seen = std::find_if(found.tags.begin(), found.tags.end(),
                                   [&](const TagSighting& s) { return s.tag_id == tag.tag_id; });
    if (seen == found.tags.end()) continue;
    Eigen::Vector2d off = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < 4; ++i) off += 0.25 * (seen->corners_px[i] - tag.corners_px[i]);
    errors_px_.push_back(off.norm());
  }
  aimed_->error_px *= kForget;
  if (!errors_px_.empty()) {
    const auto middle = errors_px_.begin() + static_cast<std::ptrdiff_t>(errors_px_.size() / 2);
    std::nth_element(errors_px_.begin(), middle, errors_px_.end());
    aimed_->error_px =
        std::clamp(*middle, aimed_->error_px, kMostError * aimed_->mount.model.width);
  }
  aimed_->seen.clear();
  aimed_->strangers.clear();
  aimed_->X_VW = X_VW_;
  for (const TagSighting& tag : found.tags) {
    aimed_->seen.push_back(tag.tag_id);
    const bool stranger = std::none_of(expected.begin(), expected.end(), [&](const ExpectedTag& e) {
      return e.tag_id == tag.tag_id && e.known;
    });
    if (stranger) aimed_->strangers.push_back(tag);
  }
}

}  // namespace fiducap
