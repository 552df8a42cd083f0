#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <Eigen/Core>

namespace fiducap {

/// Clock shifts that are tried: as far as ±0.8 s, in steps that a turn over 0.3 s hardly feels.
namespace lags {
constexpr int kSide = 40;
constexpr std::size_t kCount = 2 * kSide + 1;
constexpr double kStep_s = 0.02;
[[nodiscard]] constexpr double seconds(std::size_t lag) {
  return (static_cast<double>(lag) - kSide) * kStep_s;
}
}  // namespace lags

constexpr std::size_t kMostPairs = 48;

/// What a camera saw of one turn, and what the gyro says of it for each shift of the camera's
/// clock.
struct TurnPair {
  Eigen::Vector3d camera{Eigen::Vector3d::Zero()};   ///< rad, body axes as they are configured.
  double sigma_rad{};                                ///< Per axis, of the camera's.
  std::array<Eigen::Vector3f, lags::kCount> gyro{};  ///< rad, t_imu = stamp + lags::seconds.

  /// Between the lags by a straight line. @pre within them
  [[nodiscard]] Eigen::Vector3d gyro_at(double shift_s) const;
};

/// Which axes are tried.
enum class AxesTried {
  kAsConfigured,
  kTurned,     ///< Any rotation.
  kReflected,  ///< Any rotation with a reflection: two axes swapped, or one sign wrong.
};

/// gyro(t + shift) = A · camera(t), as well as it goes.
struct TurnFit {
  double shift_s{};
  double shift_sigma_s{};  ///< Infinite: turns too steadily to tell.
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};
  double axes_sigma_rad{};  ///< About the axis that is known worst.
  std::size_t kept{};       ///< The better three quarters of the turns: what follows is of them.
  /// Share of the motion: 0: everything is explained, 2: nothing is.
  double unexplained{2};
  double inliers{0};  ///< Share of the turns that lie within what is usual for the others.
  /// Mean square misfit per axis, in units of what the corners' noise explains: a right fit leaves
  /// about 0.4.
  double misfit{};
  /// Mean square of the gyro's turns along their principal axes, rad², falling.
  Eigen::Vector3d excitation_rad2{Eigen::Vector3d::Zero()};
};

/// The best fit within a range of shifts.
/// @pre pairs not empty, at most kMostPairs
[[nodiscard]] TurnFit fit_turns(std::span<const TurnPair> pairs, AxesTried axes,
                                double shift_from_s, double shift_to_s);

}  // namespace fiducap
