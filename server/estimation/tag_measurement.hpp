#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "base/assert.hpp"
#include "detection/corner_projection.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

using Matrix83d = Eigen::Matrix<double, 8, 3>;
using Matrix8d = Eigen::Matrix<double, 8, 8>;

/// One tag of an image with what is known about its place: in the state, or given.
struct TagToUse {
  const TagObservation* seen{};
  int local{-1};            ///< Index of the tag in the filter's state, or -1 …
  const KnownTag* known{};  ///< … and then this.
};

/// The innovation of one tag and how it depends on the state; three columns per block.
struct TagMeasurement {
  struct Block {
    int at{};  ///< First column in the state.
    Matrix83d H;
  };
  static constexpr std::size_t kMaxBlocks = 10;

  int tag_id{};
  Vector8d y{Vector8d::Zero()};  ///< seen − predicted, raw pixels
  std::array<Block, kMaxBlocks> blocks{};
  std::size_t block_count{0};
  Matrix8d R{Matrix8d::Identity()};  ///< covariance of what no state block explains
  bool in_front{true};

  /// Adds to the block that starts at column `at`.
  void add(int at, const Matrix83d& H) {
    for (std::size_t i = 0; i < block_count; ++i) {
      if (blocks[i].at != at) continue;
      blocks[i].H += H;
      return;
    }
    FIDUCAP_ASSERT(block_count < kMaxBlocks);
    blocks[block_count++] = {at, H};
  }
};

}  // namespace fiducap
