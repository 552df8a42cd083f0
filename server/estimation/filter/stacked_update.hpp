#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// Largest squared Mahalanobis distance of a tag that is used.
struct GateLimits {
  double of_tag{};            ///< Chi-square of 8.
  double of_three_corners{};  ///< Chi-square of 6.
};

/// The joint Kalman update with all tags of one image, independent of the filter's coordinates.
/// Keeps its memory between images.
///
/// The eight numbers of a tag in the relative form (TagMeasurement::relative) are whitened and
/// rotated by an orthogonal matrix so that six of them depend on the pose; the other two are pure
/// noise, count for distances and are not stacked. The covariance of the shared pose with the state
/// is computed once per image.
///
/// `P` is the live covariance of the state, n × n and symmetric. Order of use: prepare and gate,
/// then solve, with prepare again before each further solve, then shrink.
class StackedUpdate final {
 public:
  using Covariance = Eigen::Ref<Eigen::MatrixXd>;
  using ConstCovariance = Eigen::Ref<const Eigen::MatrixXd>;

  /// Prepares an image at its linearisation point.
  void prepare(ConstCovariance P, const ImageMeasurement& image);

  /// Accepts the measurements whose Mahalanobis distance by the *joint* covariance is below the
  /// limit (chi-square of 8): a tag seen again after drift closes the loop. A tag of which one
  /// corner is an outlier (occlusion, glare) is used without it: the noise of that corner grows.
  /// @param accepted  out: per measurement
  void gate(ConstCovariance P, ImageMeasurement& image, const GateLimits& limits,
            std::vector<bool>& accepted);
  /// The image was measured again: removes the same corners.
  void remove_outliers(ImageMeasurement& image) const;

  /// Result of gate() for one measurement.
  struct Judged {
    double distance{};     ///< yᵀ S⁻¹ y; NaN: behind the camera
    double noise_share{};  ///< trace R / trace S; uneven: after whitening
    int outlier{-1};       ///< Corner that is not used.
  };
  [[nodiscard]] std::span<const Judged> judged() const { return judged_; }

  [[nodiscard]] bool empty() const { return used_.empty(); }
  [[nodiscard]] std::span<const std::size_t> used() const { return used_; }
  /// Of the result of solve().
  [[nodiscard]] int degrees_of_freedom() const;

  /// @param held  first columns of six-wide blocks that are not corrected (Schmidt)
  /// @return normalised innovation squared yᵀ S⁻¹ y; the correction is in correction()
  double solve(ConstCovariance P, const ImageMeasurement& image, std::span<const int> held);
  [[nodiscard]] Eigen::Ref<const Eigen::VectorXd> correction() const { return dx_.head(n_); }

  /// Score of the shared pose by the last solve(): Hᵀ S⁻¹ H and Hᵀ S⁻¹ y with H the derivative of
  /// all innovations by that pose.
  struct SharedScore {
    Matrix6d information;
    Vector6d score;
    /// Hᵀ R⁻¹ H: information about the pose if the tags' poses were exact.
    Matrix6d by_known_tags;
  };
  /// Once per solve().
  [[nodiscard]] SharedScore shared_score(const ImageMeasurement& image);

  /// P ← P − K S Kᵀ of the last solve(), see kalman::shrink().
  void shrink(Covariance P, std::span<const int> held);

  /// RMS over the corners of the used tags, raw pixels.
  [[nodiscard]] double rms_px(const ImageMeasurement& image) const;

 private:
  using ParameterMatrix = Eigen::Matrix<double, 6, ParameterColumns::kAll>;

  /// A relative measurement after rotation.
  struct Turned {
    Matrix6d H;  ///< upper triangular
    Vector6d y;
    ParameterMatrix H_parameters;  ///< the camera's, then the tag's size
    double noise{};                ///< variance of each number
    double rest_square{};          ///< normalised square of the two noise numbers
  };

  [[nodiscard]] static Turned turn(const TagMeasurement& m, bool parameters);
  void reserve(Eigen::Index rows);
  void stack(ConstCovariance P, const ImageMeasurement& image);
  void stack_gain(ConstCovariance P, const TagMeasurement& m, const Turned& turned,
                  Eigen::Index at);
  void stack_gain(ConstCovariance P, const TagMeasurement& m, Eigen::Index at);
  void stack_parameters(ConstCovariance P, const ParameterColumns& parameters,
                        const TagMeasurement& m, const Turned& turned, Eigen::Index at);
  void view_gain(const ImageMeasurement& image);
  void stack_scatter(const ParameterColumns& parameters, const TagMeasurement& m,
                     const Turned& turned, Eigen::Index at);
  void stack_scatter(const TagMeasurement& m, Eigen::Index at);
  [[nodiscard]] Judged judge(ConstCovariance P, const ImageMeasurement& image,
                             const TagMeasurement& m, const Turned& turned) const;
  [[nodiscard]] Judged judge(ConstCovariance P, const ImageMeasurement& image,
                             const TagMeasurement& m) const;
  [[nodiscard]] Judged judge_three_corners(ConstCovariance P, const ImageMeasurement& image,
                                           const TagMeasurement& m) const;
  void add_parameters(ConstCovariance P, const ParameterColumns& parameters,
                      const TagMeasurement& m, const Turned& turned, Matrix6d& S) const;

  Eigen::Index n_{0};
  Eigen::Index rows_{0};  ///< of the stack
  std::vector<std::size_t> used_;
  std::vector<Judged> judged_;  ///< per measurement of the last gate()
  std::vector<Turned> turned_;  ///< per relative measurement of the last prepare()
  /// Covariance of the state with the shared pose, n × 6.
  Eigen::Matrix<double, Eigen::Dynamic, 6> shared_;
  Matrix6d shared_own_;  ///< covariance of the shared pose itself
  Eigen::MatrixXd PHt_;  ///< n × rows; after solve() the square-root gain K S^{1/2}
  // Rows of PHt, transposed: of the shared pose, of the parameters, of one tag or another number.
  Eigen::Matrix<double, Eigen::Dynamic, 6> shared_rows_;
  Eigen::Matrix<double, Eigen::Dynamic, ParameterColumns::kAll> parameter_rows_;
  Eigen::Matrix<double, Eigen::Dynamic, 6> own_rows_;
  /// Hᵀ by the shared pose, after shared_score() L⁻¹ H: 6 × rows, padded with zeros to whole tiles.
  Eigen::Matrix<double, 8, Eigen::Dynamic> shared_H_;
  Eigen::MatrixXd S_;  ///< lower triangle
  Eigen::VectorXd y_;
  Eigen::VectorXd dx_;
  std::vector<unsigned char> held_mask_;
};

}  // namespace fiducap
