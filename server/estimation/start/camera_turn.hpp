#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Geometry>

#include "capture/imu_sample.hpp"
#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"

/// Rotations of a camera, by tags that need not be mapped, and of the gyroscope.
namespace fiducap {

/// The attitudes of the largest tags of one image.
struct ImageAttitudes {
  static constexpr std::size_t kTags = 4;
  /// Both planar poses of a tag.
  struct Tag {
    int tag_id{};
    std::array<Eigen::Quaterniond, 2> q_VT;
    std::array<Eigen::Matrix3d, 2> covariance;  ///< Rotation vector in V axes, rad².
    std::array<double, 2> cost{};               ///< −2 log likelihood; infinite: impossible.
  };

  Instant at{};  ///< As stamped, without the estimated clock offset.
  std::array<TagObservation, kTags> seen;
  std::array<Tag, kTags> tags;  ///< Of `seen`, after solve().
  std::size_t count{0};
  bool is_solved{false};

  void take(const TagObservations& image);
  /// Once. @param corner_noise_px  of tags without a noise of their own
  void solve(const CameraModel& camera, double corner_noise_px);
};

/// How a camera rotated between two of its images.
struct CameraTurn {
  Eigen::Vector3d turn_V{Eigen::Vector3d::Zero()};  ///< Rotation vector V1 ← V2, rad.
  Eigen::Matrix3d covariance{Eigen::Matrix3d::Zero()};
};

/// Weighted mean over the tags that both images show. Of a tag whose two planar poses rotate
/// differently, both count by their probability.
/// @return nullopt: no common tag, or two tags contradict each other
[[nodiscard]] std::optional<CameraTurn> turn_between(const ImageAttitudes& before,
                                                     const ImageAttitudes& after);

/// Integral of the gyroscope's rates, for the rotation over any short span.
///
/// With S(t) = ∫ω and K(t) = ½∫ S×ω the rotation vector from a to b is, to second order (Magnus),
/// ΔS + ΔK − ½ S(a)×ΔS; the third order is below 0.003 rad at a rotation of 0.3 rad. Keeps five
/// seconds; is cleared when samples pause, go backwards or are saturated.
class GyroIntegral final {
 public:
  /// @param range_rad_s  end of the measurement range; 0: not known
  explicit GyroIntegral(double range_rad_s = 0) : range_rad_s_(range_rad_s) {}

  void add(const ImuSample& imu);
  /// @param unit  rad/s per unit of the samples
  /// @pre covers(from, to)
  [[nodiscard]] Eigen::Vector3d turn(Instant from, Instant to, double unit = 1) const;
  [[nodiscard]] bool covers(Instant from, Instant to) const {
    return end_ > begin_ && from >= Instant{begin_ * kStep} && to <= end();
  }
  /// The newest covered instant. @pre covers any
  [[nodiscard]] Instant end() const { return Instant{(end_ - 1) * kStep}; }

 private:
  static constexpr Duration kStep = std::chrono::milliseconds(5);
  static constexpr std::int64_t kSteps = 1024;
  struct Sums {
    Eigen::Vector3d S{Eigen::Vector3d::Zero()};
    Eigen::Vector3d K{Eigen::Vector3d::Zero()};
  };

  [[nodiscard]] Sums at(Instant t) const;
  [[nodiscard]] const Sums& step(std::int64_t i) const {
    return sums_[static_cast<std::size_t>(i & (kSteps - 1))];
  }

  double range_rad_s_;
  std::array<Sums, kSteps> sums_{};
  std::int64_t begin_{0};  ///< First covered step.
  std::int64_t end_{0};    ///< One after the last.
  std::optional<ImuSample> last_;
  Sums last_sums_;
};

}  // namespace fiducap
