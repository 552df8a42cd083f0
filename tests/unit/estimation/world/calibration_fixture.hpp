#pragma once

#include <gmock/gmock.h>

#include <cmath>
#include <vector>

#include "base/pose.hpp"
#include "estimation/world/calibration_monitor.hpp"

namespace fiducap::world {

/// A body with one camera and one tag, all doubted.
class CalibrationMonitorTest : public testing::Test {
 protected:
  CalibrationMonitorTest() {
    state_.reset({Pose{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}}});
    state_.P().diagonal().head<layout::kBodySize>().setConstant(1e-12);
    monitor_.begin(state_);
  }

  double& variance(int column) { return state_.P()(column, column); }
  double sigma(int column) { return std::sqrt(variance(column)); }

  /// Kalman update with the measurement `y` = `h` x of standard deviation `sigma`, of the common
  /// size and the body's position.
  void measure(double on_size, double y, double sigma) {
    auto P = state_.P();
    Eigen::VectorXd h = Eigen::VectorXd::Zero(state_.size());
    h(size_) = on_size;
    h(layout::kPosition) = 1;
    const double innovation = y - on_size * state_.sizes.common - place_;
    const double S = h.dot(P * h) + sigma * sigma;
    const Eigen::VectorXd K = P * h / S;
    P -= (K * K.transpose() * S).eval();
    state_.sizes.common += K(size_) * innovation;
    place_ += K(layout::kPosition) * innovation;
  }
  /// All prints are 2 % larger.
  void measure_larger_prints() {
    place_ = 0;
    measure(1e-3, 2e-5, 1e-6);
  }
  /// Tests the parameters with as many images, by default with enough for a decision.
  void test_parameters(int images = 25, double dispersion = 1.0) {
    for (int i = 0; i < images; ++i) monitor_.update_tests(state_, 0, dispersion);
  }
  std::vector<FoundMismatch> found(const CalibrationMonitor& monitor) {
    std::vector<FoundMismatch> out;
    monitor.list(state_, out);
    return out;
  }
  CalibrationMonitor begin_again(const CalibrationMonitor::Rules& options) {
    CalibrationMonitor monitor(sensors_, options);
    state_.reset({Pose{}});
    monitor.begin(state_);
    return monitor;
  }
  void configure_lens(double focal, double centre_px, double k1) {
    mounts_[0].focal_sigma = focal;
    mounts_[0].centre_sigma_px = centre_px;
    mounts_[0].k1_sigma = k1;
  }
  static auto is_closed() { return testing::Field(&ParameterTest::is_open, false); }

  static constexpr int kFocal = layout::focal(0);
  static constexpr int kReadout = layout::readout(0);
  BodySensors sensors_{.cameras = std::vector<CameraMount>(1)};
  std::vector<CameraMount>& mounts_ = sensors_.cameras;
  CalibrationMonitor monitor_{sensors_, {}};
  FilterState state_;
  const int size_ = layout::sizes(1);
  double place_{0};
};

}  // namespace fiducap::world
