#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

/// Rotations of a camera and of the gyro over the same short times, and how they fit together.
namespace fiducap {

/// How a camera turned between two of its images, by tags that both show. The tags need not be
/// mapped.
struct CameraTurn {
  Eigen::Vector3d turn_V{Eigen::Vector3d::Zero()};  ///< Rotation vector, camera axes.
  double sigma_rad{};                               ///< Per axis, from the corner noise.
};

/// The largest tags of one image.
struct LargestTags {
  static constexpr std::size_t kTags = 4;

  Instant at{};  ///< As stamped, without the estimated clock offset.
  std::array<TagObservation, kTags> tags;
  std::size_t count{0};

  void take(const TagObservations& seen);
};

/// Compares at most two tags, the largest first; nullopt when they disagree. A single tag counts
/// only if both of its planar poses turn equally or one is clearly wrong.
/// @param corner_noise_px  of tags without a noise of their own
[[nodiscard]] std::optional<CameraTurn> turn_between(const LargestTags& before,
                                                     const LargestTags& after,
                                                     const CameraModel& camera,
                                                     double corner_noise_px);

/// Integral of the gyro's rates, for the rotation over any short span.
///
/// The integral in body axes is the rotation vector to first order; over a third of a second the
/// remainder is far below the noise of a tag's attitude. Keeps five seconds; is cleared when
/// readings pause, go backwards or are clipped.
class GyroIntegral final {
 public:
  /// @param range_rad_s  end of the measurement range; 0: not known
  explicit GyroIntegral(double range_rad_s = 0) : range_rad_s_(range_rad_s) {}

  void add(const ImuSample& imu);
  /// @return nullopt when the span is not covered
  [[nodiscard]] std::optional<Eigen::Vector3d> turn(Instant from, Instant to) const;
  /// The covered span, without gaps; empty when both are equal.
  [[nodiscard]] Instant begin() const { return Instant{begin_ * kStep}; }
  [[nodiscard]] Instant end() const { return Instant{(end_ - 1) * kStep}; }
  [[nodiscard]] bool covers(Instant from, Instant to) const {
    return end_ > begin_ && from >= begin() && to <= end();
  }

 private:
  static constexpr Duration kStep = std::chrono::milliseconds(5);
  static constexpr std::int64_t kSteps = 1024;

  [[nodiscard]] Eigen::Vector3d at(Instant t) const;
  [[nodiscard]] static std::size_t place(std::int64_t step) {
    return static_cast<std::size_t>(step & (kSteps - 1));
  }

  double range_rad_s_;
  std::array<Eigen::Vector3d, kSteps> sums_{};
  std::int64_t begin_{0};  ///< First covered step.
  std::int64_t end_{0};    ///< One after the last.
  std::optional<ImuSample> last_;
  Eigen::Vector3d last_sum_{Eigen::Vector3d::Zero()};
};

/// The clock shifts that are tried: up to ±0.8 s, in steps much shorter than a turn (0.3 s).
namespace lags {
constexpr int kSide = 40;
constexpr std::size_t kCount = 2 * kSide + 1;
constexpr double kStep_s = 0.02;
[[nodiscard]] constexpr double seconds(std::size_t lag) {
  return (static_cast<double>(lag) - kSide) * kStep_s;
}
}  // namespace lags

constexpr std::size_t kMostPairs = 48;

/// One turn by the camera, and by the gyro for each shift of the camera's clock.
struct TurnPair {
  Eigen::Vector3d camera{Eigen::Vector3d::Zero()};   ///< rad, configured body axes.
  double sigma_rad{};                                ///< Per axis, of the camera's turn.
  std::array<Eigen::Vector3f, lags::kCount> gyro{};  ///< rad, t_imu = stamp + lags::seconds.

  /// Linear between the lags. @pre within them
  [[nodiscard]] Eigen::Vector3d gyro_at(double shift_s) const;
};

enum class AxesTried {
  kAsConfigured,
  kTurned,     ///< Any rotation.
  kReflected,  ///< Any rotation with a reflection: two axes swapped, or one sign wrong.
};

/// Least-squares fit of gyro(t + shift) = A · camera(t).
struct TurnFit {
  double shift_s{};
  double shift_sigma_s{};  ///< Infinite when the rotation is too steady.
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};
  double axes_sigma_rad{};  ///< About the least determined axis.
  std::size_t kept{};       ///< Number of the best-fitting three quarters; all below is of them.
  double unexplained{2};    ///< Share of the motion, from 0 (all explained) to 2 (none).
  double inliers{0};        ///< Share of the turns within the scatter of the others.
  /// Mean square misfit per axis relative to the corner noise: about 0.4 for a correct fit.
  double misfit{};
  /// Mean square of the gyro's turns along their principal axes, rad², falling.
  Eigen::Vector3d excitation_rad2{Eigen::Vector3d::Zero()};
};

/// The best fit within a range of shifts.
/// @pre pairs not empty, at most kMostPairs
[[nodiscard]] TurnFit fit_turns(std::span<const TurnPair> pairs, AxesTried axes,
                                double shift_from_s, double shift_to_s);

/// Result of comparing one camera with the gyro.
struct AgreementFinding {
  enum class Kind {
    kAgree,          ///< Axes and clock are as expected.
    kAxesTurned,     ///< The camera (or the gyro) is turned against its configured axes.
    kAxesReflected,  ///< Two axes of the gyro are swapped, or a sign is wrong.
    kAxesApart,      ///< One of both: the body turns about too few axes to decide.
    kShifted,        ///< The clock offset is outside of the configured tolerance.
    kJumped,         ///< The clock offset was right and has changed.
  } kind{Kind::kAgree};
  Eigen::Matrix3d A{Eigen::Matrix3d::Identity()};  ///< gyro = A · camera, body axes.
  double axes_sigma_rad{};                         ///< About the least determined axis.
  double shift_s{};                                ///< t_imu = configured time + shift.
  double shift_sigma_s{};
  double jump_s{};  ///< Of kJumped: change of `shift_s`.

  /// Angle of the rotation A. @pre A is no reflection
  [[nodiscard]] double angle_rad() const;
};

/// What is known of a camera's clock before its turns are compared.
struct ExpectedShift {
  double shift_s{};
  double tolerance_s{};
  bool was_measured{false};     ///< By turns before: a difference is a jump.
  bool axes_were_wrong{false};  ///< Agreement has to exclude the earlier finding.
};

/// The simplest single cause that explains the turns: as expected, another shift, other axes.
/// @param pairs  oldest first
/// @return nullopt: too little motion, or no cause explains it
[[nodiscard]] std::optional<AgreementFinding> find_cause(std::span<const TurnPair> pairs,
                                                         const ExpectedShift& expected);

}  // namespace fiducap
