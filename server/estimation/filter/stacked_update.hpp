#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "estimation/filter/tag_measurement.hpp"

namespace fiducap {

/// The Kalman update with all tags of one image at once, in whatever coordinates the filter has.
/// Keeps its memory between images.
///
/// A tag's eight numbers that are seen through one pose alone (TagMeasurement::relative) are turned
/// (uneven ones first made even, by the root of their covariance) by an orthogonal matrix so that
/// six of them carry all that the pose shows; the other two hold nothing but noise, count for
/// distances, and are not stacked. The covariance of the shared pose with the state is computed
/// once per image.
///
/// `P` is the live covariance of the state, n × n and symmetric. Order of use: prepare and gate,
/// then solve, with prepare again before each further solve, then shrink.
class StackedUpdate final {
 public:
  using Covariance = Eigen::Ref<Eigen::MatrixXd>;
  using ConstCovariance = Eigen::Ref<const Eigen::MatrixXd>;

  /// Takes over where the image is linearised.
  void prepare(ConstCovariance P, const ImageMeasurement& image);

  /// Takes in the measurements whose Mahalanobis distance on the *joint* covariance is below
  /// `limit` (chi-square of 8), so that a tag seen again after drift counts as the loop closure it
  /// is.
  /// @param accepted  out: per measurement, whether it was taken in
  void gate(ConstCovariance P, const ImageMeasurement& image, double limit,
            std::vector<bool>& accepted);

  /// What gate() saw of one measurement.
  struct Judged {
    double distance{};     ///< yᵀ S⁻¹ y; NaN when it lies behind the camera
    double noise_share{};  ///< trace R / trace S; of uneven ones in units of their noise
  };
  [[nodiscard]] std::span<const Judged> judged() const { return judged_; }

  [[nodiscard]] bool empty() const { return used_.empty(); }
  [[nodiscard]] std::span<const std::size_t> used() const { return used_; }
  /// Of what solve() answers.
  [[nodiscard]] int degrees_of_freedom() const { return 8 * static_cast<int>(used_.size()); }

  /// @param held  first columns of six-wide blocks that must not learn (Schmidt's consider states)
  /// @return normalised innovation squared yᵀ S⁻¹ y; the correction stands in correction()
  double solve(ConstCovariance P, const ImageMeasurement& image, std::span<const int> held);
  [[nodiscard]] Eigen::Ref<const Eigen::VectorXd> correction() const { return dx_.head(n_); }

  /// What the last solve() says of the shared pose, whatever its covariance: with H the derivative
  /// of all innovations by that pose, Hᵀ S⁻¹ H and Hᵀ S⁻¹ y.
  struct SharedScore {
    Matrix6d information;
    Vector6d score;
    /// Hᵀ R⁻¹ H: what the image would say of the pose if its tags' places were exact.
    Matrix6d by_known_tags;
  };
  /// Once per solve().
  [[nodiscard]] SharedScore shared_score(const ImageMeasurement& image);
  /// Takes in all that lies before the camera, for the score alone: solve() may follow, shrink()
  /// may not.
  void use_all(const ImageMeasurement& image);
  /// Back to these.
  void use(const std::vector<std::size_t>& measurements) { used_ = measurements; }

  /// P ← P − K S Kᵀ of the last solve(): symmetric by construction. What held blocks know of each
  /// other stays; their correlation with the rest follows, so that their uncertainty is neither
  /// forgotten nor counted twice.
  void shrink(Covariance P, std::span<const int> held);

  /// RMS over the corners of the used tags, raw pixels.
  [[nodiscard]] double rms_px(const ImageMeasurement& image) const;

 private:
  using SuspectsMatrix = Eigen::Matrix<double, 6, SuspectColumns::kAll>;

  /// A relative measurement after turning.
  struct Turned {
    Matrix6d H;  ///< upper triangular
    Vector6d y;
    SuspectsMatrix H_suspects;  ///< the camera's, then the print's size
    double noise{};             ///< variance of each number
    double rest_square{};  ///< of the two numbers that hold nothing but noise, in variances of it
  };

  [[nodiscard]] static Turned turn(const TagMeasurement& m, bool suspects);
  void reserve(Eigen::Index rows);
  void stack(ConstCovariance P, const ImageMeasurement& image);
  void stack_gain(ConstCovariance P, const TagMeasurement& m, const Turned& turned,
                  Eigen::Index at);
  void stack_gain(ConstCovariance P, const TagMeasurement& m, Eigen::Index at);
  void stack_suspects(ConstCovariance P, const SuspectColumns& suspects, const TagMeasurement& m,
                      const Turned& turned, Eigen::Index at);
  void view_gain(const ImageMeasurement& image);
  void stack_scatter(const SuspectColumns& suspects, const TagMeasurement& m, const Turned& turned,
                     Eigen::Index at);
  void stack_scatter(const TagMeasurement& m, Eigen::Index at);
  [[nodiscard]] Judged judge(ConstCovariance P, const ImageMeasurement& image,
                             const TagMeasurement& m, const Turned& turned) const;
  [[nodiscard]] Judged judge(ConstCovariance P, const ImageMeasurement& image,
                             const TagMeasurement& m) const;
  void add_suspects(ConstCovariance P, const SuspectColumns& suspects, const TagMeasurement& m,
                    const Turned& turned, Matrix6d& S) const;

  Eigen::Index n_{0};
  Eigen::Index rows_{0};  ///< of the stack
  std::vector<std::size_t> used_;
  std::vector<Judged> judged_;  ///< per measurement of the last gate()
  std::vector<Turned>
      turned_;  ///< per measurement of the last prepare(); of those that are relative
  Eigen::Matrix<double, Eigen::Dynamic, 6>
      shared_;           ///< covariance of the state with the shared pose, n × 6
  Matrix6d shared_own_;  ///< covariance of the shared pose itself
  Eigen::MatrixXd PHt_;  ///< n × rows; after solve() the square-root gain K S^{1/2}
  // Rows of PHt that others are compared with, each rows_ × …: of the shared pose, of the
  // suspects, of one tag, or of another number.
  Eigen::Matrix<double, Eigen::Dynamic, 6> shared_rows_;
  Eigen::Matrix<double, Eigen::Dynamic, SuspectColumns::kAll> suspect_rows_;
  Eigen::Matrix<double, Eigen::Dynamic, 6> own_rows_;
  /// Hᵀ by the shared pose; after shared_score() L⁻¹ H: 6 × rows, and zeros for whole tiles.
  Eigen::Matrix<double, 8, Eigen::Dynamic> shared_H_;
  Eigen::MatrixXd S_;  ///< its lower triangle
  Eigen::VectorXd y_;
  Eigen::VectorXd dx_;
  std::vector<unsigned char> held_mask_;
};

}  // namespace fiducap
