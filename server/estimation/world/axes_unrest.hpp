#pragma once

#include <chrono>
#include <utility>

#include "base/pose.hpp"
#include "base/so3.hpp"
#include "base/time.hpp"

namespace fiducap::world {

/// For a while after its axes were moved far, images correct a filter by degrees: what is not
/// linear then looks like a lens or a print that is wrong.
class AxesUnrest final {
 public:
  /// @param X_new_old  by which the map moved a body that now is at X_WB
  void note(const Pose& X_new_old, const Pose& X_WB, Instant now) {
    const double moved_m = (X_WB.p - (X_new_old.inverse() * X_WB).p).norm();
    const bool is_far = moved_m > kFar_m || log_so3(X_new_old.q).norm() > kFar_rad;
    if (std::exchange(is_first_, false) || is_far) until_ = now + kLasts;
  }
  [[nodiscard]] bool is_on(Instant now) const { return now < until_; }

 private:
  static constexpr Duration kLasts = std::chrono::seconds(2);
  static constexpr double kFar_m = 0.1;
  static constexpr double kFar_rad = 0.02;

  bool is_first_{true};
  Instant until_{Instant::min()};
};

}  // namespace fiducap::world
