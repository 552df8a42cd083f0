#include "segment/example_segment.hpp"

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "estimation/segment/motion_segment.hpp"
#include "estimation/world/propagation.hpp"
#include "example_tags.hpp"
#include "known_motion.hpp"

namespace fiducap {

namespace {

const Eigen::Vector3d kBiasF(0.05, -0.04, 0.06);
const Eigen::Vector3d kBiasW(0.006, -0.004, 0.005);
// Without IMU the negative rate is stored as gyro bias.
const Eigen::Vector3d kMinusRate(-0.1, 0.2, -0.4);

}  // namespace

ExampleSegment::ExampleSegment(const Setup& setup) : setup_(setup) {
  SegmentSensors sensors;
  sensors.has_imu = setup.has_imu;
  sensors.gravity_m_s2 -= setup.gravity_more_m_s2;
  sensors.cameras.resize(static_cast<std::size_t>(setup.cameras));
  for (CameraMount& mount : sensors.cameras) mount.model = example_camera();
  segment.sensors = std::make_shared<const SegmentSensors>(std::move(sensors));
  for (int c = 0; c < setup.cameras; ++c) add_camera(c);
  segment.gravity_offset_m_s2 = setup.gravity_more_m_s2;
  state_.reset({});
  state_.gravity_offset_m_s2 = setup.gravity_more_m_s2;
  state_.X_WB.q = Motion::q(0);
  state_.v_WB = setup.has_imu ? Motion::v(0) : Eigen::Vector3d(0.5, 0.1, -0.05);
  if (setup.has_imu) state_.bias_f = kBiasF;
  state_.bias_w = setup.has_imu ? kBiasW : kMinusRate;
  segment.instances.push_back({moment(), {}, {}});
  std::vector<std::pair<std::size_t, int>> images;
  for (int k = 0; k < setup.images; ++k) {
    for (int c = 0; c < setup.cameras; ++c) {
      go_to(k * setup.image_period_s + c * setup.camera_lag_s);
      images.emplace_back(segment.instances.size() - 1, c);
      if (c == 0 && k % 2 == 0) hang_tag(k);
    }
  }
  for (const auto& [instance, camera] : images) {
    SegmentImage image{camera, 0, setup.jitter_s, {}};
    const std::array<Pose, 3> X_WV = rows(instance, camera);
    for (const KnownTag& tag : segment.tags)
      if (auto sighting = sight(tag, X_WV)) image.tags.push_back(*sighting);
    segment.instances[instance].images.push_back(std::move(image));
  }
}

std::optional<SegmentFactor> ExampleSegment::condensed() const {
  MotionSegment copy = segment;
  return condense(copy);
}

void ExampleSegment::add_camera(int c) {
  CameraBelief belief;
  belief.X_BV = {exp_so3({0.1, 1.5 + 0.1 * c, 0.2}), {0.05, -0.02 + 0.1 * c, 0.03}};
  belief.shift_s = setup_.shift_s;
  belief.readout_s = setup_.readout_s;
  belief.rows_apart = setup_.readout_s != 0;
  belief.lens = setup_.lens;
  segment.cameras.push_back(belief);
}

BodyMoment ExampleSegment::moment() const {
  return {at_s(t_s_), state_.X_WB, state_.v_WB, state_.bias_f, state_.bias_w};
}

InertialInput ExampleSegment::input(double t_s) const {
  InertialInput out;
  out.has_accelerometer = setup_.has_imu;
  if (!setup_.has_imu) {
    out.accel_noise = 3;
    out.gyro_walk = 6;
    return out;
  }
  const ImuSample reading = Motion::imu(t_s);
  out.w_B = reading.w_WB_B + kBiasW;
  out.f_B = reading.f_B + kBiasF;
  out.gyro_noise = 2e-3;
  out.accel_noise = 2e-2;
  out.gyro_walk = 2e-4;
  out.accel_walk = 5e-3;
  return out;
}

void ExampleSegment::go_to(double t_s) {
  constexpr double kRounding_s = 1e-9;
  if (t_s <= t_s_) return;
  std::vector<SegmentStep> steps;
  while (t_s - t_s_ > kRounding_s) {
    const double dt = std::min(setup_.step_s, t_s - t_s_);
    steps.push_back({input(t_s_ + 0.5 * dt), dt});
    world::step_mean(state_, steps.back().input, {0, 0, -segment.sensors->gravity_m_s2}, dt);
    t_s_ += dt;
  }
  segment.instances.push_back({moment(), std::move(steps), {}});
}

/// In view now.
void ExampleSegment::hang_tag(int tag_id) {
  const int k = tag_id;
  const Pose X_VT{exp_so3({2.8 + 0.05 * k, 0.3 - 0.05 * k, 0.3}),
                  {0.3 * std::sin(2.0 * k), 0.2 * std::cos(2.0 * k), 1.6 + 0.05 * k}};
  segment.tags.push_back({tag_id, 0.2, state_.X_WB * segment.cameras[0].X_BV * X_VT, {}});
  segment.scales.push_back(setup_.scale);
}

std::array<Pose, 3> ExampleSegment::rows(std::size_t instance, int camera) const {
  const MotionSegment::Instance& here = segment.instances[instance];
  const InertialInput last =
      instance == 0 ? segment.instances[1].steps.front().input : here.steps.back().input;
  const BodyMoment& body = here.body;
  Eigen::Vector3d a_W = Eigen::Vector3d::Zero();
  if (setup_.has_imu)
    a_W = body.X_WB.q * (last.f_B - body.bias_f) -
          Eigen::Vector3d(0, 0, segment.sensors->gravity_m_s2);
  std::array<Pose, 3> out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    // For milliseconds the last reading is extrapolated, for lack of a later one.
    const double s = setup_.shift_s + 0.5 * (static_cast<double>(i) - 1) * setup_.readout_s;
    const Pose X_WB{body.X_WB.q * exp_so3(s * (last.w_B - body.bias_w)),
                    body.X_WB.p + s * body.v_WB + 0.5 * s * s * a_W};
    out[i] = X_WB * segment.cameras[static_cast<std::size_t>(camera)].X_BV;
  }
  return out;
}

std::optional<SegmentSighting> ExampleSegment::sight(const KnownTag& tag,
                                                     const std::array<Pose, 3>& X_WV) const {
  constexpr double kClosest_m = 0.1;
  const CameraModel lens = setup_.lens.applied_to(segment.sensors->cameras.front().model);
  SegmentSighting out;
  out.noise_px = 0.4;
  out.is_even = setup_.is_even;
  out.covariance = 0.16 * Matrix8d::Identity();
  out.covariance(0, 2) = out.covariance(2, 0) = 0.1;
  out.seen.tag_id = tag.tag_id;
  out.seen.edge_m = tag.edge_m;
  const double edge_m = (1 + setup_.scale) * tag.edge_m;
  for (int i = 0; i < 4; ++i) {
    const auto k = static_cast<std::size_t>(i);
    // Each corner is in one of the three rows, at any position: the sums are the same.
    const std::size_t row = k % 3;
    const Eigen::Vector3d p_VP = X_WV[row].inverse() * (tag.X_WT * tag_corner(i, edge_m));
    const auto px = p_VP.z() > kClosest_m ? lens.project(p_VP) : std::nullopt;
    const bool is_inside =
        px && px->x() > 0 && px->x() < lens.width && px->y() > 0 && px->y() < lens.height;
    if (!is_inside) return std::nullopt;
    out.seen.rows[k] = 0.5 * (static_cast<double>(row) - 1);
    out.seen.raw_px[k] = *px;
    out.seen.corners_px[k] = *px;  // the configured lens does not bend
    out.seen.ideal_from_raw[k].setIdentity();
  }
  return out;
}

MotionSegment moved(MotionSegment segment, const Eigen::VectorXd& error) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const int cameras = static_cast<int>(segment.cameras.size());
  const auto move = [&](BodyMoment& body, int at) {
    body = moved(body, Vector15d(error.segment<15>(at)));
  };
  move(segment.instances.front().body, kBegin);
  move(segment.instances.back().body, kEnd);
  for (int c = 0; c < cameras; ++c) {
    CameraBelief& belief = segment.cameras[static_cast<std::size_t>(c)];
    const int at = camera(c);
    belief.X_BV = world::moved(belief.X_BV, error.segment<6>(at));
    belief.shift_s += error(at + 6);
    belief.readout_s += error(at + 7);
    belief.lens.focal += error(at + 8);
    belief.lens.centre_px += error.segment<2>(at + 9);
    belief.lens.k1 += error(at + 11);
  }
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    Pose& X = segment.tags[i].X_WT;
    const auto number = static_cast<int>(i);
    X = world::moved(X, error.segment<6>(tag(cameras, number)));
    segment.scales[i] += error(scale(cameras, number));
  }
  if (segment.has_imu())
    segment.gravity_offset_m_s2 += error(gravity(cameras, static_cast<int>(segment.tags.size())));
  return segment;
}

MotionSegment in_other_axes(const Pose& G, MotionSegment segment) {
  for (MotionSegment::Instance& instance : segment.instances)
    instance.body = in_other_axes(G, instance.body);
  for (KnownTag& tag : segment.tags) tag.X_WT = G * tag.X_WT;
  return segment;
}

}  // namespace fiducap
