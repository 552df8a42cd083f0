#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "support/bound/bound_problem.hpp"
#include "support/bound/linearisation.hpp"

namespace fiducap::bound {

/// The smallest error that any causal estimator can have on average: posterior Cramér–Rao bound.
///
/// Covariance of an error-state filter linearised at the true motion and the true map (P.
/// Tichavský, C. Muravchik, A. Nehorai, "Posterior Cramér-Rao bounds for discrete-time nonlinear
/// filtering", IEEE TSP 1998). Position and heading of W are gauge: with an unknown map they are
/// fixed at the start, exactly, which changes nothing that is measured from a tag. Tags join
/// without any prior: their six most informative combinations of corners make them, the other two
/// are a measurement of the rest. The two-fold planar pose counts as solved, the corners'
/// covariance as known. Errors that last while a tag is in view are eight states more of it, which
/// fade. The covariance of the tags, which do not move, uses all data; at their end it is the
/// smoothing bound, the limit of a joint solution.
class CausalBound final {
 public:
  explicit CausalBound(BoundProblem problem);
  CausalBound(const CausalBound&) = delete;
  CausalBound& operator=(const CausalBound&) = delete;

  /// Along the truth; the first call starts. Instants must increase; steps of a few milliseconds.
  void move_to(const TruthSample& truth);
  /// An image at the instant of the last move. @param ids  tags of the problem, any order
  void see(std::span<const int> ids);
  /// The same with a noise of each tag's own.
  void see(std::span<const TagSight> sights);
  /// nullopt before the reference tag was seen.
  [[nodiscard]] std::optional<BoundAt> now() const;
  [[nodiscard]] MapBound map() const;
  /// Of the tags seen so far; place and heading of the body at the start are exact.
  /// @pre !map_known
  [[nodiscard]] TagsCovariance tags() const;

  /// Rotation, position of the body (6), then position, rotation of the tag (6): joint covariance.
  /// @pre tag was seen
  [[nodiscard]] Matrix12 body_and_tag(int tag_id) const;

 private:
  struct Place {
    const RecordedTag* tag{};
    int at{-1};  ///< Row of its error; −1: not in the state.
  };
  /// Errors that last, of a tag in view.
  struct Visit {
    int tag_id{};
    int at{};  ///< Row of its eight errors.
    Instant last_seen{};
  };
  void start(const TruthSample& truth);
  void apply_motion();
  /// @return row of the tag's lasting errors, as they are now; −1: there are none
  [[nodiscard]] int lasting_at(int tag_id);
  void fade(const Visit& visit);
  [[nodiscard]] std::size_t index_of(int tag_id) const;
  /// Jacobian of a measurement by the part of the state that starts at row `at`.
  struct Part {
    int at{};
    Eigen::MatrixXd H;
  };
  using Measurement = std::vector<Part>;  ///< Unit noise; zero by the other parts.
  /// A tag's first six combinations of corners, which make it.
  struct Newcomer {
    Place* place{};
    Measurement by_others;
    Eigen::Matrix<double, 6, 6> R;
  };
  /// P Hᵀ
  [[nodiscard]] Eigen::MatrixXd times(const Measurement& measurement) const;
  void update(const std::vector<Measurement>& all);
  void join(const Newcomer& one);
  [[nodiscard]] Eigen::Block<Eigen::MatrixXd> P() { return P_.topLeftCorner(size_, size_); }
  [[nodiscard]] Eigen::Block<const Eigen::MatrixXd> P() const {
    return P_.topLeftCorner(size_, size_);
  }
  [[nodiscard]] double camera_sigma(const Place& reference) const;

  BoundProblem problem_;
  std::vector<Place> places_;
  std::vector<Visit> visits_;
  std::optional<TruthSample> truth_;
  Matrix15 Phi_;  ///< Since the covariance was last moved.
  Matrix15 Q_;
  bool moved_{};
  Eigen::MatrixXd P_;
  int size_{kFirstTag};
};

}  // namespace fiducap::bound
