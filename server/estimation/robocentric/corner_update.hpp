#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "capture/camera_model.hpp"
#include "detection/corner_projection.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/robocentric/filter_state.hpp"

namespace fiducap::robocentric {

/// The innovation of one tag and how it depends on the state; three columns per block.
struct TagMeasurement {
  struct Block {
    int at{};  ///< First column in the state.
    Eigen::Matrix<double, 8, 3> H;
  };
  static constexpr std::size_t kMaxBlocks = 8;

  int tag_id{};
  Vector8d y{Vector8d::Zero()};
  std::array<Block, kMaxBlocks> blocks{};
  std::size_t block_count{0};
  Eigen::Matrix<double, 8, 8> R{};
  bool in_front{true};

  void add(int at, const Eigen::Matrix<double, 8, 3>& H);
};

/// One tag of an image with what is known about its place: in the state, or given.
struct TagToUse {
  const TagObservation* seen{};
  int local{-1};                 ///< Index in FilterState::tags, or -1 …
  const KnownTag* known{};       ///< … and then this.
};

/// Innovation and Jacobian of one tag, RCARS II-D4. A tag in the state depends on itself alone when camera 0 sees it
/// (that is what robocentric is good for); another camera adds both extrinsics; a known tag depends on the body.
[[nodiscard]] TagMeasurement measure(const FilterState& state, int camera, const CameraModel& model, const TagToUse& tag,
                                     double corner_noise_px);

/// Where the tag stands in the axes of `camera`, by the state's mean.
[[nodiscard]] Pose predicted_tag(const FilterState& state, int camera, const TagToUse& tag);

/// The Kalman update with all tags of one image at once. Keeps its memory between images.
class CornerUpdate final {
 public:
  struct Options {
    double corner_noise_px{};
    double gate{};        ///< Chi-square limit for the 8 numbers of one tag; a tag above it is left out.
    int iterations{1};    ///< 1: plain EKF. More: iterated, for a first image far from the linearisation point.
    /// Where the first linearisation is done, when somebody knows better than the prior mean; nullptr: at the prior.
    const FilterState* start{nullptr};
  };

  /// @param accepted  out: per entry of `tags`, whether it was used
  UpdateReport apply(FilterState& state, int camera, const CameraModel& model, std::span<const TagToUse> tags,
                     const Options& options, std::vector<bool>& accepted);

 private:
  void build(const FilterState& state, int camera, const CameraModel& model, std::span<const TagToUse> tags,
             double corner_noise_px);
  void keep_inside_gate(const FilterState& state, double gate, std::vector<bool>& accepted);
  void refer_to(const FilterState& prior, const FilterState& state);
  void stack(const FilterState& state);

  std::vector<TagMeasurement> measurements_;
  std::vector<std::size_t> used_;
  Eigen::MatrixXd PHt_;  ///< size × 8·used
  Eigen::MatrixXd S_;
  Eigen::VectorXd y_;
  Eigen::VectorXd dx_;
};

}  // namespace fiducap::robocentric
