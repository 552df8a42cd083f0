#pragma once

#include <Eigen/Core>
#include <array>
#include <bitset>
#include <span>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/found_mismatch.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/start/starting_filter.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap::world {

/// Sigmas of a calibration parameter.
struct ParameterSigmas {
  double closed{};   ///< Prior of the configuration.
  double open{};     ///< Prior when the configuration is wrong.
  double settled{};  ///< Known well enough to be reported.
};

/// Tests the configured calibration (lens, shutter, mount, tag sizes, IMU), and estimates what is
/// significantly wrong.
///
/// Each parameter is in the state with the prior of the configuration, N(0, D). An exact one has a
/// prior so tight that it has no effect. The posterior N(b̂, P) of the parameters gives the
/// likelihood of the data: information Λ = P⁻¹ − D⁻¹ and score u = P⁻¹ b̂ (a score test;
/// B. Friedland, IEEE Trans. Autom. Control 14, 1969, treats such biases apart from the state).
///
/// When a closed parameter is beyond `kOpen_sigma` for some images, the groups of parameters (a
/// lens, a mount, …) with the largest evidence are opened: a wide prior replaces that of the
/// configuration from the beginning, by a measurement with negative information. The evidence of
/// priors D is ½ uᵀ (Λ + D⁻¹)⁻¹ u − ½ log |1 + D Λ| (D. MacKay, Neural Computation 4, 1992). Groups
/// that explain the data about as well are opened together, and the data that follow decide. Sizes
/// of single tags are watched a few at a time.
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

  /// @param sensors  kept by reference; a readout is only tested where it is configured as exact
  CalibrationMonitor(const BodySensors& sensors, const Rules& rules)
      : sensors_(sensors), rules_(rules) {}

  /// Initialises the parameters of a state that was just reset.
  void begin(FilterState& state);
  /// After begin(): opens parameters that another filter found wrong in the same start.
  void open_found(FilterState& state, std::span<const WrongNumber> wrong) const;
  /// Parameters of cameras and IMU that were opened.
  [[nodiscard]] std::vector<WrongNumber> found_wrong(const FilterState& state) const;
  /// Watches the size of the next tag, if possible. @param is_doubted  it was given up before
  void watch_print(FilterState& state, int tag_id, bool is_doubted = false) const;
  /// After an image of `camera` has corrected the state.
  /// @param dispersion  mean normalised innovation squared per degree of freedom
  /// @return whether a parameter was opened: its effect was taken for noise until now
  bool update_tests(FilterState& state, int camera, double dispersion);
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
  /// Opens the parameters that are open in the map (KnownMap::wrong_prints, …).
  /// @return whether a parameter was opened
  bool follow_map(FilterState& state, const KnownMap& map, int body_id) const;
  /// Resets the tests of closed parameters.
  void reset_tests(FilterState& state) const;
  /// Without an IMU: keeps an image with few tags from correcting lenses, and any image from
  /// correcting tag sizes. Until FilterState::release_blocks().
  /// @param tags  of the image
  void hold_parameters(FilterState& state, std::size_t tags) const;
  /// Appends the opened parameters that are known well enough to be reported.
  void list(const FilterState& state, std::vector<FoundMismatch>& out) const;
  /// Covariance missing in that of the body (world-side error): of assumed errors, and of closed
  /// parameters, by the probability that each is wrong.
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
    int at{};       ///< Column of the state; axis 0 … 2 of a camera's position or attitude.
    ParameterSigmas sigmas;
    bool is_refined{false};  ///< Never closed.
    double assumed_sigma{};  ///< Assumed error that is not tested; 0: none.

    [[nodiscard]] bool is_of_mount() const {
      return kind == FoundMismatch::Kind::kMountPosition ||
             kind == FoundMismatch::Kind::kMountRotation;
    }
  };
  /// Score of a likely error: 90 % of right parameters are below.
  static constexpr double kLikely_sigma = 2.0;
  /// Rows of one test: 18 common ones, and of four cameras (three with exact mounts).
  static constexpr int kMostRows = 64;
  static constexpr int kMostOfGroup = 6;
  using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostRows, kMostRows>;
  using RowVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostRows, 1>;
  using Opened = std::bitset<kMostRows>;
  /// Likelihood of the tested parameters: ℓ(b) = uᵀ b − ½ bᵀ Λ b.
  struct Likelihood {
    std::array<std::size_t, kMostRows> rows{};  ///< In `all_`.
    std::size_t count{0};
    RowMatrix information;
    RowVector score;
  };
  struct Posterior {
    RowVector mean;
    RowMatrix covariance;
    double evidence{};  ///< Log of the mean likelihood over the prior, relative to that at zero.
  };
  /// A closed group: its error is zero, or that of an opened group with some probability.
  struct Doubt {
    std::array<std::size_t, kMostOfGroup> rows{};  ///< In `all_`.
    int count{0};
    Eigen::Matrix<double, kMostOfGroup, kMostOfGroup> moment =
        Eigen::Matrix<double, kMostOfGroup, kMostOfGroup>::Zero();
  };

  [[nodiscard]] static double value(const FilterState& state, const Parameter& parameter);
  [[nodiscard]] double value_of_mount(const FilterState& state, const Parameter& parameter) const;
  [[nodiscard]] double offset(const FilterState& state, const Parameter& parameter) const {
    return parameter.is_of_mount() ? value_of_mount(state, parameter) : value(state, parameter);
  }
  /// ∂ parameter / ∂ state.
  [[nodiscard]] static Eigen::VectorXd derivative(const FilterState& state,
                                                  const Parameter& parameter);
  [[nodiscard]] static double covariance(const FilterState& state, const Parameter& a,
                                         const Parameter& b);
  /// Covariance of the body's pose with a parameter.
  [[nodiscard]] static Vector6d body_column(const FilterState& state, const Parameter& parameter);
  [[nodiscard]] double sigma_of(const FilterState& state, const Parameter& parameter) const;
  [[nodiscard]] double prior_sigma(const FilterState& state, std::size_t row) const {
    return state.parameter_tests[row].is_open ? all_[row].sigmas.open : all_[row].sigmas.closed;
  }
  [[nodiscard]] double score(const FilterState& state, const Parameter& parameter) const;
  static void assume(Parameter& parameter, double sigma);
  /// Id of the tag of a kOnePrint; -1: free.
  [[nodiscard]] static int watched_tag(const FilterState& state, const Parameter& parameter) {
    return state.sizes.watched[static_cast<std::size_t>(parameter.print)].tag_id;
  }
  [[nodiscard]] static bool is_same_group(const Parameter& a, const Parameter& b);
  void add_lens(int camera);
  void add_mount(int camera);
  void add_motion(const FilterState& state);
  void add_finding(const FilterState& state, std::size_t row, bool is_ambiguous,
                   std::vector<FoundMismatch>& out) const;
  [[nodiscard]] bool are_significant(const FilterState& state,
                                     const std::vector<std::size_t>& rows) const;
  [[nodiscard]] Likelihood likelihood(const FilterState& state, int camera,
                                      double dispersion) const;
  [[nodiscard]] std::vector<std::size_t> select(const Likelihood& of) const;
  [[nodiscard]] Posterior posterior(const Likelihood& of, const Opened& opened) const;
  void average(const FilterState& state, const Likelihood& of);
  void list_doubts();
  void widen_opened(FilterState& state, const std::vector<std::size_t>& opened) const;
  bool set_open(FilterState& state, int camera, const Likelihood& of,
                const std::vector<std::size_t>& opened) const;
  void change_priors(FilterState& state, int camera, const std::vector<std::size_t>& rows) const;
  void set_drift_prior(FilterState& state) const;  ///< For the propagation.
  void release_confirmed_prints(FilterState& state) const;

  const BodySensors& sensors_;
  Rules rules_;
  std::vector<Parameter> all_;
  std::vector<Doubt> doubts_;
  int images_since_test_{0};
  int next_camera_{0};  ///< Whose rows are tested first.
};

}  // namespace fiducap::world
