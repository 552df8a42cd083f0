#pragma once

#include <gtest/gtest.h>

#include "estimation/world/calibration_monitor.hpp"
#include "world/example_state.hpp"

namespace fiducap::world {

inline constexpr int kLongEnough = 25;        // images that a test has to last for
inline constexpr std::size_t kSizeOfAll = 5;  // behind four numbers of the lens and the readout

/// A body with one camera and one tag, all doubted, correlated with the size of all prints as a
/// linear measurement of both makes them.
class CalibrationMonitorTest : public testing::Test {
 protected:
  CalibrationMonitorTest() : monitor_(mounts_, {}) {
    mounts_.resize(1);
    state_.reset({Pose{exp_so3({0.1, -1.5, 0.2}), {0.05, -0.02, 0.03}}});
    state_.P().diagonal().head<layout::kBodySize>().setConstant(1e-12);
    monitor_.begin(state_);
    size_ = layout::sizes(1);
  }

  /// Kalman update with the measurement `y` = `h` x of standard deviation `sigma`; only size and
  /// body position have a mean.
  void measure(double on_size, double y, double sigma, double on_focal = 0) {
    auto P = state_.P();
    Eigen::VectorXd h = Eigen::VectorXd::Zero(state_.size());
    h(size_) = on_size;
    h(layout::focal(0)) = on_focal;
    h(layout::kPosition) = 1;
    const double predicted = on_size * state_.sizes.common + place_;
    const double S = h.dot(P * h) + sigma * sigma;
    const Eigen::VectorXd K = P * h / S;
    P -= (K * K.transpose() * S).eval();
    state_.sizes.common += K(size_) * (y - predicted);
    place_ += K(layout::kPosition) * (y - predicted);
  }

  std::vector<CameraMount> mounts_;
  CalibrationMonitor monitor_;
  FilterState state_;
  int size_{};
  double place_{0};
};

}  // namespace fiducap::world
