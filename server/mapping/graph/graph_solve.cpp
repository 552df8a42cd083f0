// How a map graph is solved, and where W is afterwards.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "estimation/world/filter_state.hpp"
#include "mapping/graph/calibration_terms.hpp"
#include "mapping/graph/map_graph.hpp"

namespace fiducap {

namespace {

constexpr int kMostIterations = 40;
constexpr double kLeastDamping = 1e-9;
constexpr double kMostDamping = 1.0;
// A step that reduces the cost by less than this moves every variable by less than a third of its
// sigma.
constexpr double kConverged = 0.05;
constexpr double kBetweenLinearisations = 1.0;
// A segment is linearised again when a pose in it has moved relative to its beginning by more than
// this: in angle, or as a share of its distance. Segments with different linearisation points have
// spurious information about a tag's heading, which adds up over the segments.
constexpr double kTurned_rad = 0.0003;
constexpr double kMoved = 0.0006;
// … or a camera by one of these: m, rad, clock and readout in s, focal length, px, distortion.
using CameraNumbers = Eigen::Array<double, segment_layout::kCameraSize, 1>;
const CameraNumbers kCameraMoved{
    {2e-4, 2e-4, 2e-4, 3e-4, 3e-4, 3e-4, 4e-5, 8e-5, 2e-3, 2.0, 2.0, 1e-2}};
constexpr double kScaled = 0.002;            // … or a tag size.
constexpr double kGravityMoved_m_s2 = 1e-4;  // times tilts: microradians
constexpr double kImuChanged = 0.001;        // relative and rad; tests find 0.002

bool has_moved(const Pose& was, const Vector6d& by) {
  const double shifted = (world::moved(was, by).p - was.p).norm();
  return by.tail<3>().norm() > kTurned_rad || shifted > kMoved * (0.5 + was.p.norm());
}

/// The filter has found errors of the IMU since.
bool has_changed(const ImuIntrinsics& was, const ImuIntrinsics& now) {
  return (now.accel_scale - was.accel_scale).cwiseAbs().maxCoeff() > kImuChanged ||
         (now.gyro_turn - was.gyro_turn).cwiseAbs().maxCoeff() > kImuChanged ||
         (now.gyro_scale - was.gyro_scale).cwiseAbs().maxCoeff() > kImuChanged;
}

/// @param error  against the linearisation point
bool is_elsewhere(const GraphSegment& segment, const ImuIntrinsics& imu,
                  const Eigen::VectorXd& error) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  if (has_changed(segment.raw.imu, imu)) return true;
  const SegmentFactor& f = segment.factor;
  const int cameras = static_cast<int>(f.cameras.size());
  for (int c = 0; c < cameras; ++c)
    if ((error.segment<kCameraSize>(camera(c)).array().abs() > kCameraMoved).any()) return true;
  const int gravity_at = gravity(cameras, static_cast<int>(f.tags.size()));
  if (segment.raw.has_imu() && std::abs(error(gravity_at)) > kGravityMoved_m_s2) return true;
  if (has_moved(f.end.X_WB, error.segment<6>(kEnd))) return true;
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const auto number = static_cast<int>(i);
    if (has_moved(f.tags[i].X_WT, error.segment<6>(tag(cameras, number))) ||
        std::abs(error(scale(cameras, number))) > kScaled)
      return true;
  }
  return false;
}

}  // namespace

std::optional<GraphSolution> MapGraph::solve(const std::stop_token& stop) {
  if (state_.segments.empty() || state_.tags.empty()) return std::nullopt;
  GraphSolution done;
  for (const GraphSegment& segment : state_.segments) done.numbers += segment.factor.numbers;
  const bool is_converged = iterate(stop, done);
  if (is_converged) align_to_reference();
  const auto covariance = is_converged ? this->covariance() : std::nullopt;
  if (stop.stop_requested()) return std::nullopt;
  if (covariance) {
    fill_solution(*covariance, done);
    reference_tag_.reset();  // W has been published: it stays there
  }
  if (!keeps_all_) keep_bounded(covariance.has_value());
  return covariance ? std::optional(std::move(done)) : std::nullopt;
}

/// Levenberg–Marquardt. Segments are linearised again on the way, where they have moved: steps with
/// old ones would overshoot or converge slowly.
/// @return whether it has converged
bool MapGraph::iterate(const std::stop_token& stop, GraphSolution& done) {
  const GraphVariables variables(state_);
  double damping = kLeastDamping;
  done.condensed += condense_again(stop);
  NormalEquations equations = normal_equations(state_, variables);
  for (done.iterations = 1; done.iterations <= kMostIterations; ++done.iterations) {
    if (stop.stop_requested()) return false;
    done.cost = 2 * equations.cost;
    const auto factor = BlockCholesky::factor(equations.H, damping);
    const Eigen::VectorXd delta =
        factor ? Eigen::VectorXd(factor->solve(equations.pull)) : Eigen::VectorXd();
    if (!factor || !delta.allFinite()) {
      damping *= 100;
      if (damping > kMostDamping) return false;
      continue;
    }
    const double gain = 0.5 * delta.dot(equations.pull);
    if (gain < kConverged) {
      // Small for the whole; for a parameter with a tight prior it may not be.
      move_by(delta, variables, equations.H, state_);
      return true;
    }
    GraphEstimates before = state_;
    move_by(delta, variables, equations.H, state_);
    const int again = condense_again(stop);
    if (stop.stop_requested()) return false;
    done.condensed += again;
    NormalEquations next = normal_equations(state_, variables);
    if (again > 0 || next.cost <= equations.cost) {
      damping = std::max(kLeastDamping, 0.1 * damping);
      equations = std::move(next);
      continue;
    }
    static_cast<GraphEstimates&>(state_) = std::move(before);
    // No step gains the little that is predicted: the limit of the linearisation.
    damping *= 100;
    if (damping > kMostDamping) return gain < kBetweenLinearisations;
  }
  return false;
}

int MapGraph::condense_again(const std::stop_token& stop) {
  int count = 0;
  for (GraphSegment& segment : state_.segments) {
    if (stop.stop_requested()) break;
    const auto body = static_cast<std::size_t>(state_.nodes[segment.begin].body);
    const ImuIntrinsics& imu = state_.bodies[first_of(body, state_)].imu;
    if (!is_elsewhere(segment, imu, error_of(state_, segment))) continue;
    MotionSegment raw = segment_now(state_, segment);
    auto factor = condense(raw);
    if (!factor) continue;
    segment.raw = std::move(raw);
    segment.factor = std::move(*factor);
    ++count;
  }
  return count;
}

std::optional<GraphCovariance> MapGraph::covariance() const {
  std::vector<std::size_t> defining;
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const GraphTag& tag = state_.tags[i];
    if (tag.component == kInWorkspace &&
        (!is_defined_ || definition_.contains({tag.tag_id, tag.epoch})))
      defining.push_back(i);
  }
  if (defining.empty()) return std::nullopt;
  auto covariance = GraphCovariance::of(state_);
  if (!covariance) return std::nullopt;
  if (!state_.prior.is_absolute) covariance->refer_to(defining);
  return covariance;
}

void MapGraph::fill_solution(const GraphCovariance& covariance, GraphSolution& out) const {
  const auto is_current = [&](const GraphTag& tag) {
    return tag.epoch == epochs_.newest(tag.tag_id);
  };
  out.findings = findings_of(covariance, state_);
  for (std::size_t i = 0; i < state_.tags.size(); ++i) {
    const GraphTag& tag = state_.tags[i];
    out.tags.push_back({tag.tag_id, tag.edge_m, tag.component, tag.sightings, tag.first_seen,
                        tag.last_seen, tag.X_WT, *covariance.between(i, i), tag.epoch,
                        is_current(tag)});
  }
  std::ranges::sort(out.tags, [](const auto& a, const auto& b) {
    return std::tuple(a.tag_id, a.component, a.epoch) < std::tuple(b.tag_id, b.component, b.epoch);
  });
  const auto is_published = [&](std::size_t i) {
    return state_.tags[i].component == kInWorkspace && is_current(state_.tags[i]);
  };
  for (const auto& [i, j] : bound_tags(state_)) {
    if (!is_published(i) || !is_published(j)) continue;
    const bool turned = state_.tags[i].tag_id > state_.tags[j].tag_id;
    const std::size_t first = turned ? j : i;
    const std::size_t second = turned ? i : j;
    if (const auto of_both = covariance.between(first, second))
      out.pairs.push_back({state_.tags[first].tag_id, state_.tags[second].tag_id, *of_both});
  }
  std::ranges::sort(out.pairs, [](const KnownPair& a, const KnownPair& b) {
    return std::pair(a.first_id, a.second_id) < std::pair(b.first_id, b.second_id);
  });
}

/// Keeps W where its definition is. Without one from the beginning it stays where it was.
void MapGraph::align_to_reference() {
  if (state_.prior.is_absolute) return;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;
  for (const GraphTag& tag : state_.tags) {
    const auto was = definition_.find({tag.tag_id, tag.epoch});
    if (was != definition_.end() && tag.component == kInWorkspace)
      points.emplace_back(tag.X_WT.p, was->second);
  }
  if (points.size() > 1) move_component(kInWorkspace, fit_yaw_and_shift(points), state_);
  if (is_defined_) return;
  definition_.clear();
  for (const GraphTag& tag : state_.tags)
    if (tag.component == kInWorkspace) definition_[{tag.tag_id, tag.epoch}] = tag.X_WT.p;
}

}  // namespace fiducap
