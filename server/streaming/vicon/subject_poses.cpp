#include "streaming/vicon/subject_poses.hpp"

#include <algorithm>
#include <utility>

#include "base/so3.hpp"

namespace fiducap::vicon {

namespace {

// A pose this uncertain has quality one half.
constexpr double kHalfGood_m = 0.02;
constexpr double kHalfGood_rad = 0.02;

}  // namespace

double quality_of(const BodyPose& body) {
  if (!body.valid) return 0.0;
  const double worst =
      std::max(body.position_sigma_m() / kHalfGood_m, body.rotation_sigma_rad() / kHalfGood_rad);
  return std::isfinite(worst) ? 1.0 / (1.0 + worst * worst) : 0.0;
}

void SubjectPoses::take_over(const SceneFrame& frame) {
  if (std::exchange(axes_number_, frame.axes) != frame.axes) held_.clear();
  all_.resize(frame.bodies.size());
  for (std::size_t i = 0; i < all_.size(); ++i) show(frame.bodies[i], all_[i]);
}

void SubjectPoses::show(const BodyPose& body, SubjectPose& out) {
  const Pose X = axes_.pose(body.X_WP);
  // Clients hand NaN on to their users unchecked.
  const bool usable = body.valid && X.p.allFinite() && X.q.coeffs().allFinite();
  out.listed = usable || when_invalid_ != WhenInvalid::kStop;
  out.visible = usable;
  out.quality = usable ? quality_of(body) : 0.0;
  out.segment.subject = static_cast<std::uint32_t>(body.body_id);
  if (usable) {
    const Eigen::Quaterniond q = X.q.normalized();
    out.segment.t_mm = X.p;
    out.segment.R = q.toRotationMatrix();
    out.segment.rotation_vector = log_so3(q);
  }
  if (when_invalid_ != WhenInvalid::kHold) return;
  if (usable) {
    held_[body.body_id] = out.segment;
  } else if (const auto last = held_.find(body.body_id); last != held_.end()) {
    out.segment = last->second;
    out.visible = true;
  }
}

}  // namespace fiducap::vicon
