#pragma once

#include <chrono>
#include <span>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Information 1/σ² of the data about a column of the state whose prior is (0, `prior_sigma`²).
[[nodiscard]] double information_of(const FilterState& state, int column, double prior_sigma);

/// Replaces the zero-mean prior of one column: a measurement of zero with the difference of
/// information. The marginal of held tags p(tags) stays and p(rest | tags) changes, so the body
/// moves relative to them: an error of the whole map is common to column and body.
/// @param camera  whose image corrected the state last
/// @param value   of the column, as estimated
void exchange_prior(FilterState& state, int camera, int column, double value, double from_sigma,
                    double to_sigma);

/// Increases the variance of a column and what is correlated with it. Held tags and closed columns
/// keep theirs: above its prior a closed column would have negative information.
void widen(FilterState& state, int column, double sigma, const std::vector<int>& closed);

/// Suspends the tests for a while after a large change of the axes: until the filter has converged,
/// nonlinearity resembles a wrong lens or tag size.
class PostRealignmentHoldoff final {
 public:
  /// @param X_new_old  motion of a body that is at X_WB now
  void note(const Pose& X_new_old, const Pose& X_WB, Instant now) {
    const double moved_m = (X_WB.p - (X_new_old.inverse() * X_WB).p).norm();
    const bool is_far = moved_m > kFar_m || log_so3(X_new_old.q).norm() > kFar_rad;
    if (std::exchange(is_first_, false) || is_far) until_ = now + kLasts;
  }
  [[nodiscard]] bool active(Instant now) const { return now < until_; }

 private:
  static constexpr Duration kLasts = std::chrono::seconds(2);
  static constexpr double kFar_m = 0.1;
  static constexpr double kFar_rad = 0.02;

  bool is_first_{true};
  Instant until_{Instant::min()};
};

/// Sigmas of a calibration parameter.
struct ParameterSigmas {
  double tight{};    ///< Prior while closed.
  double open{};     ///< Prior while open.
  double settled{};  ///< Below this it may be closed again.
};

/// Tests the configured parameters of lens, shutter and tag sizes, and estimates those that are
/// significantly wrong.
///
/// Each parameter is in the state with a prior so tight that it has no effect while it is right.
/// Its posterior gives the estimate without prior: information λ = 1/P − 1/σ², z = b̂ / (P √λ) (a
/// score test; B. Friedland, IEEE Trans. Autom. Control 14, 1969, treats such a bias apart from the
/// state). The parameter furthest above `kOpen_sigma` for some images is opened (a lens as a
/// whole): a realistic prior replaces the tight one from the beginning, by a measurement of zero
/// with negative information. A parameter found as configured is closed again. Sizes of single tags
/// are watched a few at a time.
///
/// A lens with configured sigmas, or to be refined, is open from the beginning with its own prior
/// and never closed. Without an IMU nothing can be tested: lenses and tag sizes are held at their
/// tight priors, and the covariance of poses includes assumed errors (consider covariance).
class CalibrationMonitor final {
 public:
  struct Rules {
    bool doubts{true};    ///< Tests parameters. False: only refined ones are in the state.
    bool refines{false};  ///< Refines every lens, not only those with configured sigmas.
    bool assumes{false};  ///< Assumes errors instead of testing.
  };

  /// @param cameras  their readout is only tested where it is configured as exact
  CalibrationMonitor(const std::vector<CameraMount>& cameras, const Rules& rules)
      : cameras_(cameras), rules_(rules) {}

  /// Initialises the parameters of a state that was just reset.
  void begin(FilterState& state);
  /// After begin(): opens parameters that another filter found wrong in the same start.
  void open_found(FilterState& state, std::span<const WrongNumber> wrong) const;
  /// Lenses and readouts that were opened.
  [[nodiscard]] std::vector<WrongNumber> found_wrong(const FilterState& state) const;
  /// Watches the size of a new tag, if possible.
  void watch_print(FilterState& state, int tag_id) const;
  /// After an image of `camera` has corrected the state.
  /// @param dispersion  mean normalised innovation squared per degree of freedom
  /// @return whether a parameter was opened: its effect was taken for noise until now
  bool update_tests(FilterState& state, int camera, double dispersion) const;
  /// Test statistics of a parameter.
  struct TestStatistics {
    double score{};        ///< In sigmas of the data.
    double information{};  ///< Without the prior's.
    double variance{};
  };
  [[nodiscard]] std::vector<TestStatistics> test_statistics(const FilterState& state) const;
  /// After an exchange with the map: the map was made with the closed parameters as configured, so
  /// it must neither improve nor change their tests.
  void restore_test_statistics(FilterState& state, std::span<const TestStatistics> before) const;
  /// Opens the parameters that are open in the map (KnownMap::wrong_prints, …). A judged map resets
  /// the other tests and is the only one to open parameters for ten seconds.
  /// @return whether a parameter was opened
  bool follow_map(FilterState& state, const KnownMap& map, int body_id) const;
  /// Resets the tests of closed parameters with at least this score.
  void reset_tests(FilterState& state, double from_sigma = 0) const;
  /// Without an IMU: keeps an image with few tags from correcting lenses, and any image from
  /// correcting tag sizes. Until FilterState::release_blocks().
  /// @param tags  of the image
  void hold_parameters(FilterState& state, std::size_t tags) const;
  /// Appends the opened parameters that are known well enough to be reported.
  void list(const FilterState& state, std::vector<FoundMismatch>& out) const;
  /// Covariance missing in that of the body (world-side error): of assumed errors, and of closed
  /// parameters with a likely error.
  [[nodiscard]] Matrix6d unmodelled_covariance(const FilterState& state) const;
  /// Whether images may correct a camera's lens.
  [[nodiscard]] bool is_refined(int camera) const;
  /// Whether the lens is more uncertain than a calibrated one.
  [[nodiscard]] bool is_lens_open(const FilterState& state, int camera) const;
  /// Whether the lens is within its calibration. False: there is none.
  [[nodiscard]] bool is_as_calibrated(const FilterState& state, int camera) const;
  /// Whether the data confirm a camera's lens and readout and the common tag size.
  [[nodiscard]] bool are_confirmed(const FilterState& state, int camera) const;
  /// The open parameters of a camera's lens.
  [[nodiscard]] LensEstimate lens(const FilterState& state, int camera) const;

 private:
  struct Parameter {
    FoundMismatch::Kind kind{};
    int camera{-1};
    int print{-1};  ///< Index of the watched tag, for kOnePrint.
    int column{};
    ParameterSigmas sigmas;
    bool is_refined{false};  ///< Never closed.
    double assumed_sigma{};  ///< Assumed error that is not tested; 0: none.
  };

  [[nodiscard]] static double score(const FilterState& state, const Parameter& parameter);
  [[nodiscard]] static double value(const FilterState& state, const Parameter& parameter);
  static void assume(Parameter& parameter, double sigma);
  /// Id of the tag of a kOnePrint; -1: free.
  [[nodiscard]] static int watched_tag(const FilterState& state, const Parameter& parameter) {
    return state.sizes.watched[static_cast<std::size_t>(parameter.print)].tag_id;
  }
  void add_lens(int camera);
  void open(FilterState& state, int camera, std::size_t parameter) const;
  void release_confirmed_prints(FilterState& state) const;

  /// Score of a likely error: 90 % of right parameters are below.
  static constexpr double kLikely_sigma = 2.0;

  const std::vector<CameraMount>& cameras_;
  Rules rules_;
  std::vector<Parameter> all_;
};

}  // namespace fiducap::world
