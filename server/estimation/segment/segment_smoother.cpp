#include "estimation/segment/segment_smoother.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/segment/segment_elimination.hpp"

namespace fiducap {

namespace {
constexpr int kMostPasses = 5;
constexpr double kNearly = 1e-3;  // m and rad
constexpr double kSettled = 1e-6;

/// Without tags and images.
bool is_blind(const MotionSegment& segment) {
  return segment.tags.empty() &&
         std::ranges::all_of(segment.instances,
                             [](const MotionSegment::Instance& i) { return i.images.empty(); });
}

/// @return over the rest, before the last step of the path; nullopt: not finite, or no tag is seen
std::optional<SegmentElimination::Information> smooth(const MotionSegment& segment,
                                                      SegmentElimination& elimination) {
  // Converges quadratically.
  for (int pass = 1; pass < kMostPasses; ++pass) {
    elimination.run_path();
    if (elimination.move_inner() < kNearly) break;
  }
  for (int pass = 1;; ++pass) {
    auto info = elimination.run();
    if (!info.all.allFinite() || !std::isfinite(info.cost)) return std::nullopt;
    if (elimination.sightings() == 0 && !is_blind(segment)) return std::nullopt;
    const double step = elimination.move_inner();
    if (step < kSettled || pass == kMostPasses) return info;
  }
}

void shift(MotionSegment& segment, const Eigen::Vector3d& by) {
  for (MotionSegment::Instance& instance : segment.instances) instance.body.X_WB.p += by;
  for (KnownTag& tag : segment.tags) tag.X_WT.p += by;
}
}  // namespace

std::optional<SegmentFactor> condense(MotionSegment& segment) {
  if (segment.instances.size() < 2) return std::nullopt;
  // World-side errors are about the origin: a near one is numerically better.
  const Eigen::Vector3d origin = segment.begin().X_WB.p;
  shift(segment, -origin);
  SegmentElimination elimination(segment);
  std::optional<SegmentFactor> out;
  if (const auto info = smooth(segment, elimination))
    out = SegmentFactor{.begin = segment.begin(),
                        .end = segment.end(),
                        .cameras = segment.cameras,
                        .tags = segment.tags,
                        .scales = segment.scales,
                        .gravity_offset_m_s2 = segment.gravity_offset_m_s2,
                        .H = info->all.selfadjointView<Eigen::Lower>(),
                        .g = -info->pull,
                        .cost = info->cost,
                        .numbers = 8 * elimination.sightings(),
                        .sightings = elimination.sightings(),
                        .outliers = elimination.outliers()};
  shift(segment, origin);
  return out;
}

std::vector<PathPoint> path_between(MotionSegment& segment) {
  if (segment.instances.size() < 2) return {};
  const Eigen::Vector3d origin = segment.begin().X_WB.p;
  shift(segment, -origin);
  SegmentElimination elimination(segment);
  const auto info = smooth(segment, elimination);
  shift(segment, origin);
  if (!info) return {};
  const auto& between = elimination.eliminated();
  std::vector<PathPoint> path(between.size());
  // The end is part of the rest.
  PathPoint next{Matrix15d::Zero(), Eigen::MatrixXd::Zero(15, info->all.rows())};
  next.by_rest.middleCols<15>(segment_layout::kEnd).setIdentity();
  for (std::size_t k = between.size(); k-- > 0;) {
    const SegmentElimination::Eliminated& here = between[k];
    const Matrix15d on_next = -here.own.solve(here.on_next);
    path[k].given = here.own.solve(Matrix15d::Identity());
    path[k].given += on_next * next.given * on_next.transpose();
    path[k].by_rest = on_next * next.by_rest - here.own.solve(here.on_rest);
    next = path[k];
  }
  return path;
}

}  // namespace fiducap
