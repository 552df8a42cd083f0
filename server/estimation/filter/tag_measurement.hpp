#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "base/assert.hpp"
#include "detection/corner_covariance.hpp"
#include "detection/corner_projection.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/filter/linear_term.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

using Matrix83d = Eigen::Matrix<double, 8, 3>;

/// One tag of an image with what is known about its place: in the state, or given.
struct TagToUse {
  const TagObservation* seen{};
  int local{-1};            ///< Index of the tag in the filter's state, or -1 …
  const KnownTag* known{};  ///< … and then this.
};

/// Six numbers that all tags of an image are compared with, as a linear function of the state: the
/// error of the camera at its exposure.
struct SharedPose {
  static constexpr std::size_t kMostTerms = 7;

  std::array<LinearTerm, kMostTerms> terms{};
  std::size_t term_count{0};  ///< 0: nothing is shared.
  /// Of the pose at this image alone: what its stamp is off moves all its tags alike.
  Matrix6d noise{Matrix6d::Zero()};

  void add(int at, const Eigen::Matrix<double, 6, 3>& J) {
    FIDUCAP_ASSERT(term_count < kMostTerms);
    terms[term_count++] = {at, J};
  }
};

/// First columns of numbers that all tags of an image depend on beside the poses: what may be wrong
/// about the camera, `kOfCamera` of them, and the size of all prints. -1: none of this is in the
/// state.
struct SuspectColumns {
  static constexpr int kOfCamera = 5;
  static constexpr int kAll = kOfCamera + 1;

  int camera{-1};
  int size{-1};

  [[nodiscard]] bool are_there() const { return camera >= 0; }
};

using CameraSuspectsMatrix = Eigen::Matrix<double, 8, SuspectColumns::kOfCamera>;

/// The innovation of one tag and how it depends on the state, in one of two forms.
struct TagMeasurement {
  struct Block {
    int at{};  ///< First column in the state.
    Matrix83d H;
  };
  static constexpr std::size_t kMaxBlocks = 13;
  static constexpr int kGiven = -1;

  int tag_id{};
  Vector8d y{Vector8d::Zero()};  ///< seen − predicted, raw pixels
  bool in_front{true};

  /// Relative: all eight numbers see the six of one pose, the tag's against the shared one, by H
  /// (ξ_own − ξ_shared), and the suspects; noise is `noise_px` alike or, when it is not even, `R`.
  /// Else by `blocks` and `R`, and H only says how the shared pose's own noise enters.
  bool relative{false};
  int own{kGiven};  ///< First of the tag's own six columns, or kGiven.
  Matrix86d H{Matrix86d::Zero()};
  CameraSuspectsMatrix H_camera;  ///< On the camera's suspects; only set when there are any …
  Vector8d H_size;                ///< … and on the size of all prints and the tag's own one.
  int own_size{-1};               ///< Column of the latter, or -1.
  double noise_px{};
  bool even{true};

  std::array<Block, kMaxBlocks> blocks{};
  std::size_t block_count{0};
  Matrix8d R{Matrix8d::Identity()};  ///< covariance of what no state block explains

  /// Adds to the block that starts at column `at`.
  void add(int at, const Matrix83d& block) {
    for (std::size_t i = 0; i < block_count; ++i) {
      if (blocks[i].at != at) continue;
      blocks[i].H += block;
      return;
    }
    FIDUCAP_ASSERT(block_count < kMaxBlocks);
    blocks[block_count++] = {at, block};
  }
};

/// All tags of one image. Kept between images, for its memory.
struct ImageMeasurement {
  SharedPose shared;
  SuspectColumns suspects;
  std::vector<TagMeasurement> tags;

  /// Takes H `error` off every innovation.
  void take_off(const Eigen::VectorXd& error);
};

}  // namespace fiducap
