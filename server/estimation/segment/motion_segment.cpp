#include "estimation/segment/motion_segment.hpp"

#include <Eigen/LU>
#include <set>

#include "estimation/world/error_state.hpp"

namespace fiducap {

void remove_sightings(MotionSegment& segment,
                      const std::function<bool(const MotionSegment::Instance&, const SegmentImage&,
                                               const SegmentSighting&)>& is_out) {
  std::set<int> left;
  for (MotionSegment::Instance& instance : segment.instances) {
    for (SegmentImage& image : instance.images) {
      std::erase_if(image.tags, [&](const auto& one) { return is_out(instance, image, one); });
      for (const SegmentSighting& one : image.tags) left.insert(one.seen.tag_id);
    }
    std::erase_if(instance.images, [](const SegmentImage& image) { return image.tags.empty(); });
  }
  const std::vector<KnownTag> tags = std::exchange(segment.tags, {});
  const std::vector<double> scales = std::exchange(segment.scales, {});
  for (std::size_t i = 0; i < tags.size(); ++i) {
    if (!left.contains(tags[i].tag_id)) continue;
    segment.tags.push_back(tags[i]);
    if (!scales.empty()) segment.scales.push_back(scales[i]);
  }
}

BodyMoment moved(const BodyMoment& body, const Vector15d& error) {
  using namespace world::layout;  // NOLINT: block names
  const Eigen::Vector3d phi = error.segment<3>(kAttitude);
  BodyMoment out = body;
  out.X_WB = world::moved(body.X_WB, error.segment<6>(kPosition));
  out.v_WB = exp_so3(phi) * body.v_WB + left_jacobian_so3(phi) * error.segment<3>(kVelocity);
  out.bias_f += error.segment<3>(kBiasF);
  out.bias_w += error.segment<3>(kBiasW);
  return out;
}

Vector15d error_between(const BodyMoment& from, const BodyMoment& to) {
  using namespace world::layout;  // NOLINT: block names
  Vector15d error;
  error.segment<6>(kPosition) = world::world_error_between(from.X_WB, to.X_WB);
  const Eigen::Vector3d phi = error.segment<3>(kAttitude);
  error.segment<3>(kVelocity) =
      left_jacobian_so3(phi).inverse() * (to.v_WB - exp_so3(phi) * from.v_WB);
  error.segment<3>(kBiasF) = to.bias_f - from.bias_f;
  error.segment<3>(kBiasW) = to.bias_w - from.bias_w;
  return error;
}

BodyMoment in_other_axes(const Pose& G, const BodyMoment& body) {
  BodyMoment out = body;
  out.X_WB = G * body.X_WB;
  out.v_WB = G.q * body.v_WB;
  return out;
}

Matrix6d inverse_left_jacobian(const Vector6d& error) {
  const Eigen::Vector3d rho = error.head<3>();
  const Eigen::Vector3d phi = error.tail<3>();
  const Eigen::Matrix3d J_inv = left_jacobian_so3(phi).inverse();
  // ∂ (J_l(φ) ρ) / ∂ φ to second order of φ: relative error below 1e-3 at 0.3 rad.
  const Eigen::Matrix3d R = skew(rho);
  const Eigen::Matrix3d P = skew(phi);
  const Eigen::Matrix3d Q =
      0.5 * R + (P * R + R * P + P * R * P) / 6.0 + (P * P * R + R * P * P - 3 * P * R * P) / 24.0;
  Matrix6d out = Matrix6d::Zero();
  out.topLeftCorner<3, 3>() = J_inv;
  out.bottomRightCorner<3, 3>() = J_inv;
  out.topRightCorner<3, 3>() = -J_inv * Q * J_inv;
  return out;
}

}  // namespace fiducap
