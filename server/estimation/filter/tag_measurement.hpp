#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "base/expected.hpp"
#include "base/time.hpp"
#include "detection/tag_geometry.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/filter/growing_covariance.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

using Matrix83d = Eigen::Matrix<double, 8, 3>;

/// One tag of an image with its pose: in the state or given.
struct TagToUse {
  const TagObservation* seen{};
  int local{-1};            ///< Index of the tag in the filter's state, or -1.
  const KnownTag* known{};  ///< The given pose when `local` is -1.
};

/// Error of the camera's pose at its exposure, shared by all tags of an image: six numbers as a
/// linear function of the state.
struct SharedPose {
  static constexpr std::size_t kMostTerms = 7;

  std::array<LinearTerm, kMostTerms> terms{};
  std::size_t term_count{0};  ///< 0: nothing is shared.
  /// Covariance of the pose at this image alone: an error of its stamp shifts all its tags equally.
  Matrix6d noise{Matrix6d::Zero()};

  void add(int at, const Eigen::Matrix<double, 6, 3>& J) {
    FIDUCAP_ASSERT(term_count < kMostTerms);
    terms[term_count++] = {at, J};
  }
};

/// First columns of the calibration parameters of an image: `kOfCamera` of the camera, then the
/// common size of all tags. -1: not in the state.
struct ParameterColumns {
  static constexpr int kOfCamera = 5;
  static constexpr int kAll = kOfCamera + 1;

  int camera{-1};
  int size{-1};

  [[nodiscard]] bool are_there() const { return camera >= 0; }
};

using CameraParameterMatrix = Eigen::Matrix<double, 8, ParameterColumns::kOfCamera>;

/// The innovation of one tag and its derivative by the state, in one of two forms.
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

  /// Relative form: the eight numbers depend on one pose, the tag's relative to the shared one, by
  /// H (ξ_own − ξ_shared), and on the parameters; the noise is `noise_px`, or `R` when not even.
  /// Other form: `blocks` and `R`; H gives the influence of the shared pose's own noise.
  bool relative{false};
  int own{kGiven};  ///< First of the tag's own six columns, or kGiven.
  Matrix86d H{Matrix86d::Zero()};
  CameraParameterMatrix H_camera;  ///< By the camera's parameters, when they are in the state.
  Vector8d H_size;                 ///< By the common size of all tags and by the tag's own size.
  int own_size{-1};                ///< Column of the tag's own size, or -1.
  double noise_px{};
  bool even{true};

  std::array<Block, kMaxBlocks> blocks{};
  std::size_t block_count{0};
  Matrix8d R{Matrix8d::Identity()};  ///< noise covariance

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

/// All tags of one image. Reused between images to avoid allocations.
struct ImageMeasurement {
  SharedPose shared;
  ParameterColumns parameters;
  std::vector<TagMeasurement> tags;

  /// Subtracts H `error` from every innovation.
  void take_off(const Eigen::VectorXd& error) {
    Vector6d of_shared = Vector6d::Zero();
    for (std::size_t k = 0; k < shared.term_count; ++k)
      of_shared += shared.terms[k].J * error.segment<3>(shared.terms[k].at);
    for (TagMeasurement& m : tags) {
      if (m.relative) {
        m.y += m.H * of_shared;
        if (m.own != TagMeasurement::kGiven) m.y -= m.H * error.segment<6>(m.own);
        if (!parameters.are_there()) continue;
        m.y -= m.H_camera * error.segment<ParameterColumns::kOfCamera>(parameters.camera);
        const double own_size = m.own_size < 0 ? 0.0 : error(m.own_size);
        m.y -= m.H_size * (error(parameters.size) + own_size);
      } else {
        for (std::size_t b = 0; b < m.block_count; ++b)
          m.y -= m.blocks[b].H * error.segment<3>(m.blocks[b].at);
      }
    }
  }
};

/// Id and sightings of a tag in a filter's state.
struct TagRecord {
  int tag_id{};
  double edge_m{};
  int sightings{};
  Instant first_seen{};
  Instant last_seen{};
};

/// Index of a tag in `tags`, or -1.
template <class Tags>
[[nodiscard]] int find_tag(const Tags& tags, int tag_id) {
  const auto found = std::ranges::find(tags, tag_id, &TagRecord::tag_id);
  return found == tags.end() ? -1 : static_cast<int>(found - tags.begin());
}

}  // namespace fiducap
