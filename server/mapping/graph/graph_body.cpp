#include "mapping/graph/graph_body.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/world/filter_state.hpp"

namespace fiducap {

using namespace segment_layout;  // NOLINT: the block names are the subject of this file

namespace {

// What is exact by the configuration is known this well, and not better: m, rad, s and relative.
constexpr double kExact = 1e-7;
constexpr double kExactCentre_px = 1e-4;
// A lens or readout that was found to be wrong is as unknown as this before the images.
constexpr double kOpenFocal = 0.1;
constexpr double kOpenCentre_px = 30.0;
constexpr double kOpenDistortion = 0.1;

// A clock that goes so much otherwise, when a body is found again, has jumped.
constexpr double kJumped_s = 0.01;
// Where it has jumped to is known this well when a chain begins.
constexpr double kJumpFound_s = 0.03;

void add_square(Eigen::MatrixXd& information, Eigen::Index at, double sigma) {
  information(at, at) = 1.0 / (sigma * sigma);
}

}  // namespace

GraphBody body_by_configuration(int id, const SegmentSensors& sensors) {
  GraphBody body;
  body.id = id;
  const auto count = static_cast<Eigen::Index>(sensors.cameras.size());
  body.information = Eigen::MatrixXd::Zero(kCameraSize * count, kCameraSize * count);
  for (std::size_t c = 0; c < sensors.cameras.size(); ++c) {
    const CameraMount& mount = sensors.cameras[c];
    body.expected.push_back({.X_BV = mount.X_BV,
                             .shift_s = 0,
                             .readout_s = mount.readout_s,
                             .rows_apart = mount.readout_s != 0 || mount.readout_sigma_s != 0,
                             .lens = {}});
    const auto at = static_cast<Eigen::Index>(c) * kCameraSize;
    const bool open = sensors.estimates_extrinsics;
    Matrix6d plain = Matrix6d::Zero();
    const auto inverse_square = [](double sigma) { return 1.0 / (sigma * sigma); };
    plain.diagonal().head<3>().setConstant(
        inverse_square(open ? std::max(kExact, mount.position_sigma_m) : kExact));
    plain.diagonal().tail<3>().setConstant(
        inverse_square(open ? std::max(kExact, mount.rotation_sigma_rad) : kExact));
    const Matrix6d J = world::plain_from_world_error(mount.X_BV.p);
    body.information.block<6, 6>(at, at) = J.transpose() * plain * J;
    const bool clocks = sensors.estimates_clocks && sensors.has_imu;
    add_square(body.information, at + kClock,
               clocks ? std::max(kExact, mount.time_shift_sigma_s) : kExact);
    const auto add_told = [&](int row, double told, double exact, bool may_be_doubted) {
      if (told == 0 && sensors.doubts && may_be_doubted) {
        body.doubts[static_cast<int>(at) + row] = {};
      } else {
        add_square(body.information, at + row, std::max(exact, told));
      }
    };
    add_told(kReadout, clocks ? mount.readout_sigma_s : 0, kExact,
             !body.expected.back().rows_apart);
    add_told(kFocal, mount.focal_sigma, kExact, true);
    add_told(kCentre, mount.centre_sigma_px, kExactCentre_px, true);
    add_told(kCentre + 1, mount.centre_sigma_px, kExactCentre_px, true);
    add_told(kDistortion, mount.k1_sigma, kExact, true);
  }
  body.cameras = body.expected;
  return body;
}

bool has_other_clocks(const GraphBody& body, const MotionSegment& segment) {
  for (std::size_t c = 0; c < body.cameras.size(); ++c)
    if (std::abs(segment.cameras[c].shift_s - body.cameras[c].shift_s) > kJumped_s) return true;
  return false;
}

GraphBody with_other_clocks(const GraphBody& before, int index, const MotionSegment& since) {
  GraphBody body = before;
  body.doubts.clear();
  body.same_as = index;
  body.information.setZero();
  for (std::size_t c = 0; c < body.cameras.size(); ++c) {
    body.cameras[c].shift_s = body.expected[c].shift_s = since.cameras[c].shift_s;
    const double sigma = since.sensors->cameras[c].time_shift_sigma_s;
    add_square(body.information, static_cast<Eigen::Index>(c) * kCameraSize + kClock,
               std::max(kJumpFound_s, sigma));
  }
  return body;
}

SameNumbers information_of_same() {
  SameNumbers sigma;
  sigma << 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5,  // m and rad
      1, 1e-6,                                  // s
      1e-6, 1e-3, 1e-3, 1e-6;
  SameNumbers out = sigma.cwiseAbs2().cwiseInverse();
  out(kClock) = 0;
  return out;
}

void begin_with(const std::vector<CameraBelief>& found, GraphBody& body) {
  body.cameras = found;
  for (std::size_t c = 0; c < found.size(); ++c) {
    const auto at = static_cast<Eigen::Index>(c) * kCameraSize;
    body.expected[c].shift_s = found[c].shift_s;
    const LensOffset& lens = found[c].lens;
    if (!found[c].lens_is_open) continue;
    for (auto& [row, doubt] : body.doubts)
      if (row >= at + kFocal && row < at + kCameraSize) doubt.is_open = true;
    if (body.doubts.contains(static_cast<int>(at) + kFocal)) continue;
    // What is told to be uncertain stays as it is told.
    const auto open = [&](Eigen::Index row, double sigma, double exact) {
      constexpr double kMuchAsExact = 0.5;
      if (body.information(row, row) * exact * exact > kMuchAsExact)
        add_square(body.information, row, sigma);
    };
    open(at + kFocal, kOpenFocal, kExact);
    open(at + kCentre, kOpenCentre_px, kExactCentre_px);
    open(at + kCentre + 1, kOpenCentre_px, kExactCentre_px);
    if (lens.k1 != 0) open(at + kDistortion, kOpenDistortion, kExact);
  }
}

}  // namespace fiducap
