#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/found_mismatch.hpp"

namespace fiducap {

/// Two learned variances: factor of the IMU's configured ones; of the images' stamps, s².
struct LearnedNoise {
  Eigen::Vector2d applied{1.0, 0.0};
  /// Fading sums of the log likelihood's derivative and expected curvature at `applied`.
  Eigen::Vector2d derivative{Eigen::Vector2d::Zero()};
  Eigen::Matrix2d information{Eigen::Matrix2d::Zero()};
  /// Sum of the derivatives' third cumulants: few images with much motion make them skewed.
  Eigen::Vector2d third{Eigen::Vector2d::Zero()};
  Eigen::Vector2d weighed_at{1.0, 0.0};  ///< `applied` when the sums were last reweighted.

  [[nodiscard]] double imu_variance() const { return applied(0); }
  [[nodiscard]] double imu_information() const { return information(0, 0); }
  /// Evidence for a larger variance than the applied one, in sigmas.
  [[nodiscard]] double imu_score() const {
    return information(0, 0) > 0 ? derivative(0) / std::sqrt(information(0, 0)) : 0.0;
  }
};

/// A configured number that was found to be wrong.
struct WrongNumber {
  FoundMismatch::Kind kind{};
  int camera{-1};
};

/// What a filter learned about sensors and calibration, as prior of a trial filter that processes
/// the same start.
struct InitialisationPriors {
  LearnedNoise sensors;
  std::vector<double> corners_px;  ///< CornerNoise::unexplained_px of each camera.
  /// Lenses and readouts: with the large corner noise that a wrong one caused, it would not be
  /// found again. Tag sizes are tested again, as a wrong lens affects their tests.
  std::vector<WrongNumber> wrong;
};

/// Initial clock shifts of the cameras and their uncertainty.
struct ClockHypothesis {
  std::vector<double> shifts_s;  ///< One per camera, beyond the configured shift.
  double spread{};               ///< Their 1-sigma, in sigmas of the configured shift; 0: held.

  /// @param configured_s  1-sigma of a camera's shift
  [[nodiscard]] double sigma_s(double configured_s) const {
    constexpr double kHeld_s = 0.001;  // of a held clock
    return std::max(std::min(kHeld_s, configured_s), spread * configured_s);
  }
  friend bool operator==(const ClockHypothesis&, const ClockHypothesis&) = default;
};

/// Misfit of images: −2 log likelihood up to a constant, and the number of measured values.
struct Explanation {
  double cost{};
  double numbers{};

  Explanation& operator+=(const Explanation& other) {
    cost += other.cost;
    numbers += other.numbers;
    return *this;
  }
};

/// A filter that begins with a hypothesis about the clocks and reports how well it fits.
class StartingFilter : public BodyFilter {
 public:
  /// Misfit of the image of the last update().
  [[nodiscard]] virtual Explanation explain(const TagObservations& seen,
                                            const UpdateReport& report) const = 0;
  /// The motion is tracked.
  [[nodiscard]] virtual bool is_following() const = 0;
  /// Consecutive images with at least half of the tags rejected.
  [[nodiscard]] virtual int contradicting_images() const = 0;
  [[nodiscard]] virtual InitialisationPriors initialisation_priors() const = 0;
  virtual void begin_with(const InitialisationPriors& priors) = 0;
  /// Ends the start: later contradictions mean a clock jump or a moved tag; held clocks are free.
  virtual void end_start() = 0;
  /// Axes of published poses: whether anchored, and by which own tag; nullopt: by the map.
  struct Axes {
    bool are_anchored{};
    std::optional<int> defined_by{};
    friend bool operator==(const Axes&, const Axes&) = default;
  };
  [[nodiscard]] virtual Axes axes() const = 0;
  /// Number of complete restarts, counted from set_generation().
  [[nodiscard]] virtual int generation() const = 0;
  virtual void set_generation(int generation) = 0;
  /// Clocks after a restart; default: those of the first start.
  virtual void set_restart_clocks(ClockHypothesis clocks) = 0;
};

}  // namespace fiducap
