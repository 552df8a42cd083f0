#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "base/pose.hpp"
#include "base/time.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/known_tag.hpp"

/// The filter of RCARS, section II-D, with the paper's symbols. Axes W, B, V, T as there (II-D1).
namespace fiducap::rcars {

/// Derivative of six numbers by the six rows of the error state that begin at `at`.
struct Term {
  int at{};
  Matrix6d J;
};

/// A pose and its derivative by the error state. The error of every pose X_AB is position, then
/// rotation vector, both in A axes: p = p̂ + δp, q = exp(δφ) q̂.
struct LinearPose {
  Pose X;
  std::vector<Term> terms{};

  /// Zero when the pose does not depend on these rows.
  [[nodiscard]] Matrix6d by(int at) const;
};
[[nodiscard]] LinearPose operator*(const LinearPose& X_AB, const LinearPose& X_BC);
[[nodiscard]] LinearPose inverse(const LinearPose& X_AB);

/// First row of each block of the error state.
inline constexpr int kR = 0;   ///< r, B axes.
inline constexpr int kQ = 3;   ///< q = q̂ exp(δ), δ in B axes.
inline constexpr int kV = 6;   ///< v, B axes.
inline constexpr int kBf = 9;  ///< b_f
inline constexpr int kBw = 12;
inline constexpr int kBodySize = 15;
/// Marks an error that is not in the state: of an input, e.g. a known tag.
inline constexpr int kOutside = -1;

using BodyMatrix = Eigen::Matrix<double, kBodySize, kBodySize>;

struct Tag {
  int tag_id{};
  double edge_m{};
  Pose X_VT;  ///< r_T and the inverse of q_T: in the axes of camera 0.
  int sightings{1};
  Instant first_seen{};
  Instant last_seen{};
};

/// x of II-D3, for any number of tags and cameras, and its covariance P.
struct State {
  Instant time{};
  Eigen::Vector3d r{Eigen::Vector3d::Zero()};            ///< _B r_WB, m.
  Eigen::Vector3d v{Eigen::Vector3d::Zero()};            ///< _B v_B, m/s.
  Eigen::Quaterniond q{Eigen::Quaterniond::Identity()};  ///< q_WB
  Eigen::Vector3d b_f{Eigen::Vector3d::Zero()};          ///< m/s²
  Eigen::Vector3d b_w{Eigen::Vector3d::Zero()};          ///< rad/s
  std::vector<Pose> cameras;                             ///< X_BV: r_V and the inverse of q_V.
  std::vector<Tag> tags;
  Eigen::MatrixXd P;

  [[nodiscard]] int camera_at(int camera) const { return kBodySize + 6 * camera; }
  [[nodiscard]] int tag_at(std::size_t tag) const {
    return camera_at(static_cast<int>(cameras.size() + tag));
  }
  [[nodiscard]] int size() const { return tag_at(tags.size()); }
  [[nodiscard]] std::optional<std::size_t> find(int tag_id) const;

  /// W in B: position −r, attitude q⁻¹.
  [[nodiscard]] LinearPose X_BW() const;
  [[nodiscard]] LinearPose X_BV(int camera) const;
  [[nodiscard]] LinearPose X_VT(std::size_t tag) const;  ///< V of camera 0.
  [[nodiscard]] LinearPose X_WT(std::size_t tag) const;

  /// x ⊞ δ
  void add_error(const Eigen::VectorXd& error);
  /// Replaces the six numbers at `at` by a linear function of the state plus independent noise.
  void redefine(int at, const std::vector<Term>& terms, const Matrix6d& noise);
  [[nodiscard]] Matrix6d covariance_of(const LinearPose& pose) const;
  [[nodiscard]] BodyEstimate body() const;
};

/// Kalman update with innovation y, P Hᵀ and S = H P Hᵀ + R.
/// @return yᵀ S⁻¹ y
double correct(State& x, const Eigen::VectorXd& y, const Eigen::MatrixXd& PHt,
               const Eigen::MatrixXd& S);

}  // namespace fiducap::rcars
