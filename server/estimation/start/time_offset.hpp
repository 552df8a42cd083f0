#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "estimation/start/camera_turn.hpp"

namespace fiducap {

/// Normal distribution of a camera's clock offset: t_imu = configured time + shift.
struct ClockPrior {
  double shift_s{};
  double sigma_s{std::numeric_limits<double>::infinity()};  ///< Infinite: not known.
};

/// How the axes of camera and gyroscope may be related.
enum class Axes {
  kConfigured,  ///< As configured, up to an error that the filter estimates.
  kTurned,      ///< By any rotation.
  kReflected,   ///< By any rotation and a reflection: two axes swapped, or one sign wrong.
};

/// Most likely offset and axes: gyro(t + shift) = A · camera(t), both in configured body axes.
struct OffsetFit {
  double shift_s{};
  double shift_sigma_s{};  ///< Infinite when the rotation is too steady.
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};
  double axes_sigma_rad{};  ///< By the turns, about the least determined axis.
  double cost{};            ///< −2 log posterior, for comparing fits of the same turns.
  double misfit{};          ///< Median squared residual over that of the modelled noise.
  double unexplained{};     ///< Median squared residual over that of the gyro's turns.
  bool is_unique{true};     ///< No clearly different offset is nearly as likely.

  /// The turns are rotations, and the fit explains them.
  [[nodiscard]] bool explains() const;
};

/// Evidence: difference of −2 log likelihood at which one fit replaces another, 2 ln 10⁶. A wrong
/// configuration is expected in one body of a thousand, and a body tests thousands of times.
inline constexpr double kOffsetEvidence = 27.6;

/// The clock offset of one camera against the gyroscope, and whether its axes are as configured, by
/// maximum likelihood of a delay between two signals.
///
/// Ten times a second the rotation c of the camera over about 0.4 s (turn_between) is kept together
/// with that of the gyroscope g(d) for each offset d. The residual g(d) − T b − A c, with the span
/// T of the turn and the gyroscope's bias b, has the covariance of c. It has Student's distribution
/// with four degrees of freedom, because of moved tags and wrong planar poses. The bias has a
/// prior: during a steady angular acceleration it looks like an offset. Allocates nothing after
/// construction.
class TimeOffset final {
 public:
  static constexpr std::size_t kTurns = 48;  ///< The newest: five seconds of rotation at least.

  /// @param q_BV             configured rotation of the camera
  /// @param corner_noise_px  of tags without a noise of their own
  TimeOffset(const CameraModel& camera, const Eigen::Quaterniond& q_BV, double corner_noise_px,
             std::size_t most_turns = kTurns);

  /// @return number of new turns; they need the gyroscope's samples of the next second
  std::size_t add(const TagObservations& seen, const GyroIntegral& gyro);
  /// Keeps the image, without a turn, and forgets earlier turns. The next add() begins with the
  /// images kept.
  void keep(const TagObservations& seen);
  [[nodiscard]] std::size_t turns() const { return turns_.size(); }
  void forget_all();

  /// @param newest  number of turns to use
  [[nodiscard]] OffsetFit fit(Axes axes, const ClockPrior& prior, std::size_t newest) const;
  /// As configured, if the gyroscope's samples are in degrees per second. @param shift_s  is exact
  [[nodiscard]] OffsetFit fit_degrees(double shift_s, std::size_t newest) const;

  /// Offsets that are tried: steps much shorter than a turn.
  static constexpr double kReach_s = 0.8;
  static constexpr double kStep_s = 0.02;

 private:
  static constexpr std::size_t kImages = 24;
  static constexpr std::size_t kLags = 81;  ///< From −kReach_s to kReach_s.

  /// One turn by the camera, and by the gyroscope for each offset.
  struct Turn {
    Eigen::Vector3d camera{Eigen::Vector3d::Zero()};  ///< rad, configured body axes.
    Eigen::Matrix3d weight{Eigen::Matrix3d::Zero()};  ///< Inverse covariance.
    double span_s{};
    std::array<Eigen::Vector3f, kLags> gyro{};
    Eigen::Vector3d gyro_degrees{Eigen::Vector3d::Zero()};  ///< At no offset, if in degrees/s.

    [[nodiscard]] Eigen::Vector3d gyro_at(double shift_s) const;
  };
  /// A turn with the axes of the present fit, and its residual.
  struct Residual {
    Eigen::Vector3d gyro, rate, camera, r;
    Eigen::Matrix3d weight;
    double span_s{};
    double square{};  ///< Mahalanobis.
  };
  struct Solution;

  /// @return false: too soon after the last image
  bool take(const TagObservations& seen);
  /// The first image that has all of the images for a turn before it.
  [[nodiscard]] std::size_t first_to_pair() const;
  [[nodiscard]] ImageAttitudes& image(std::size_t number) { return images_[number % kImages]; }
  bool pair(std::size_t number, const GyroIntegral& gyro);
  void load(std::span<const Turn> turns, double shift_s) const;
  void turn_axes(Solution& at, double determinant) const;
  void solve(Solution& at, const ClockPrior* free_shift) const;
  [[nodiscard]] Solution solve_at(std::span<const Turn> turns, Axes axes, double shift_s) const;
  [[nodiscard]] OffsetFit conclude(const Solution& at) const;

  CameraModel camera_;
  Eigen::Quaterniond q_BV_;
  double corner_noise_px_;
  std::size_t most_turns_;
  std::array<ImageAttitudes, kImages> images_;
  std::size_t images_taken_{0};
  std::size_t images_paired_{0};
  std::vector<Turn> turns_;  ///< Oldest first.
  mutable std::vector<Residual> work_;
  mutable std::vector<double> sorted_;
};

}  // namespace fiducap
