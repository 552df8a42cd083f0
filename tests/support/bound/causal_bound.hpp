#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "support/bound/linearisation.hpp"

namespace fiducap::bound {

using Matrix8 = Eigen::Matrix<double, 8, 8>;

/// Errors of a tag's corners that fade while it is in view, first-order Gauss–Markov.
struct LastingErrors {
  double fades_s{};                              ///< Until 1/e of them is left.
  Duration visit_ends{std::chrono::seconds(1)};  ///< Unseen for so long: other errors.
};

/// One tag in an image.
struct TagSight {
  int tag_id{};
  Matrix8 whiten;                    ///< Its raw coordinates times this have unit white noise …
  Matrix8 lasting{Matrix8::Zero()};  ///< … and these, by eight unit errors that last.
};

/// What is known beforehand, and how noisy the sensors are.
struct BoundProblem {
  CameraMount camera;  ///< True place; its sigmas are the prior (per axis) of cases A and C.
  ImuNoise imu;
  double gravity_m_s2{9.81};
  double corner_noise_px{0.4};    ///< Per coordinate, raw pixels.
  std::vector<RecordedTag> tags;  ///< True poses.
  int reference_tag{};
  bool map_known{};         ///< Cases C and D.
  bool extrinsics_known{};  ///< Cases B and D.
  std::optional<LastingErrors> lasting{};
};

/// Root of the trace of a covariance: the RMS of the three components' joint error.
struct BoundAt {
  Instant at{};
  double position_m{};  ///< In the reference tag's axes.
  double rotation_rad{};
  double level_position_m{};  ///< In level axes at the reference tag: its place and heading only.
  double level_rotation_rad{};
  double velocity_m_s{};  ///< Body axes.
  double camera_m{};      ///< The camera's place, in the reference tag's axes.
  double extrinsics_m{};
  double extrinsics_rad{};
};

/// RMS over the tags, in the reference tag's axes.
struct MapBound {
  double position_m{};
  double rotation_rad{};
  int tags{};  ///< Without the reference tag.
};

/// The smallest error that any causal estimator can have on average: posterior Cramér–Rao bound.
///
/// Covariance of an error-state filter linearised at the true motion and the true map (P.
/// Tichavský, C. Muravchik, A. Nehorai, "Posterior Cramér-Rao bounds for discrete-time nonlinear
/// filtering", IEEE TSP 1998). Position and heading of W are gauge: with an unknown map they are
/// fixed at the start, exactly, which changes nothing that is measured from a tag. Tags join
/// without any prior: their six most informative combinations of corners make them, the other two
/// are a measurement of the rest. The two-fold planar pose is taken as solved, the corners'
/// covariance as known. Errors that last while a tag is in view are eight states more of it, which
/// fade.
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

  /// Rotation, position of the body (6), then position, rotation of the tag (6): joint covariance.
  /// @pre tag was seen
  [[nodiscard]] Eigen::Matrix<double, 12, 12> body_and_tag(int tag_id) const;

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
  /// Rows of a measurement in the state so far.
  struct Row {
    Eigen::MatrixXd H_body;  ///< Columns 0..20.
    Eigen::MatrixXd H_tag;   ///< Six columns, or none.
    int tag_at{-1};
    Eigen::MatrixXd H_lasting{};  ///< Eight columns, or none.
    int lasting_at{-1};
  };
  /// A tag's first six combinations of corners, which make it.
  struct Newcomer {
    Place* place{};
    Row row;
    Eigen::Matrix<double, 6, 6> R;
  };
  /// P Hᵀ
  [[nodiscard]] Eigen::MatrixXd times(const Row& row) const;
  void update(const std::vector<Row>& rows);
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
