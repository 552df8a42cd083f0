#include "pipeline/replay/settled_trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/so3.hpp"
#include "detection/observe.hpp"
#include "detection/tag_pose.hpp"
#include "mapping/refinement.hpp"
#include "mapping/refinement_residuals.hpp"

namespace fiducap {

namespace {

constexpr double kInlierSigmas = 5.0;
constexpr double kFirstInlierSigmas = 50.0;
// What a tag behind the camera counts: that of one a whole image away.
constexpr double kBehind_px = 1000.0;
// Where two answers explain an instant equally well, the one that lies nearer to the instants
// before and after is right. A hand-carried body turns and moves this far at once; from kWander on,
// its variance grows with the time between.
constexpr double kTurnSigma_rad = 0.5;
constexpr double kMoveSigma_m = 1.0;
constexpr Duration kWander = std::chrono::seconds(2);
// A settled pose is left only for one that is cheaper by this much (chi-square): the same pose
// found again is no news.
constexpr double kWorthLeaving = 1.0;
constexpr std::size_t kProposingTags =
    4;  // the largest ones; further ones would only repeat what these say
constexpr int kRounds = 3;

double size_px(const TagObservation& tag) { return (tag.corners_px[0] - tag.corners_px[2]).norm(); }

double misfit(const Pose& X_WB, const std::vector<SightedTag>& tags, double noise_px) {
  double cost = 0;
  for (const SightedTag& tag : tags) {
    const Pose X_VT = (X_WB * tag.X_BV).inverse() * tag.X_AT;
    const CornerResidual r = corner_residual(*tag.seen, X_VT, *tag.camera);
    cost += robust_square(r.in_front ? r.y : Vector8d::Constant(kBehind_px), noise_px);
  }
  return cost;
}

double jump(const Pose& X_WB, Instant at, const std::vector<StampedPose>& neighbours) {
  double cost = 0;
  for (const StampedPose& other : neighbours) {
    const double turns = angle_between(X_WB.q, other.X_WB.q) / kTurnSigma_rad;
    const double moves = (X_WB.p - other.X_WB.p).norm() / kMoveSigma_m;
    const double wander =
        std::max(1.0, to_seconds(std::chrono::abs(at - other.at)) / to_seconds(kWander));
    cost += (turns * turns + moves * moves) / wander;
  }
  return cost;
}

}  // namespace

void SettledTrajectory::add(const TagObservations& seen, const std::optional<Pose>& X_WB,
                            const std::vector<KnownTag>& tags) {
  if (seen.tags.empty()) return;
  if (frames_.empty() || frames_.back().at != seen.exposed_at)
    frames_.push_back({seen.exposed_at, {}, {}, {}});
  Frame& frame = frames_.back();
  frame.images.push_back(seen);
  if (!X_WB) return;
  const TagObservation* nearest = nullptr;
  const KnownTag* then = nullptr;
  for (const TagObservation& tag : seen.tags) {
    const auto found = std::find_if(tags.begin(), tags.end(),
                                    [&](const auto& t) { return t.tag_id == tag.tag_id; });
    if (found == tags.end() || (nearest != nullptr && size_px(tag) <= size_px(*nearest))) continue;
    nearest = &tag;
    then = &*found;
  }
  if (then != nullptr) frame.proposals.push_back({then->tag_id, then->X_WT.inverse() * *X_WB});
}

void SettledTrajectory::propose_planar_poses(Frame& frame,
                                             const std::vector<CameraMount>& cameras) const {
  std::vector<std::pair<const TagObservation*, const CameraMount*>> seen;
  for (const TagObservations& image : frame.images)
    for (const TagObservation& tag : image.tags)
      seen.emplace_back(&tag, &cameras.at(static_cast<std::size_t>(image.camera)));
  std::stable_sort(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
    return size_px(*a.first) > size_px(*b.first);
  });
  if (seen.size() > kProposingTags) seen.resize(kProposingTags);
  for (const auto& [tag, camera] : seen) {
    for (const TagPose& pose : solve_tag_pose(*tag, camera->model)) {
      if (std::isfinite(pose.rms_px))
        frame.proposals.push_back({tag->tag_id, (camera->X_BV * pose.X_VT).inverse()});
    }
  }
}

std::vector<SightedTag> SettledTrajectory::sightings(const Frame& frame,
                                                     const std::vector<CameraMount>& cameras,
                                                     const TagPoses& map) {
  std::vector<SightedTag> sighted;
  for (const TagObservations& image : frame.images) {
    const CameraMount& camera = cameras[static_cast<std::size_t>(image.camera)];
    for (const TagObservation& tag : image.tags) {
      if (const auto found = map.find(tag.tag_id); found != map.end())
        sighted.push_back({&tag, &camera.model, camera.X_BV, found->second});
    }
  }
  return sighted;
}

std::optional<Pose> SettledTrajectory::place(const Frame& frame,
                                             const std::vector<CameraMount>& cameras,
                                             const TagPoses& map,
                                             const std::vector<StampedPose>& neighbours) const {
  const std::vector<SightedTag> sighted = sightings(frame, cameras, map);
  if (sighted.empty()) return std::nullopt;
  const auto improved = [&](const Pose& proposed) {
    const Pose near = resect(proposed, sighted, kFirstInlierSigmas * corner_noise_px_);
    return resect(near, sighted, kInlierSigmas * corner_noise_px_);
  };
  const auto cost_of = [&](const Pose& X_WB) {
    return misfit(X_WB, sighted, corner_noise_px_) + jump(X_WB, frame.at, neighbours);
  };
  std::optional<Pose> best = frame.X_WB;
  double best_cost =
      best ? cost_of(*best) - kWorthLeaving : std::numeric_limits<double>::infinity();
  for (const Proposal& proposal : frame.proposals) {
    const auto tag = map.find(proposal.tag_id);
    if (tag == map.end()) continue;
    const Pose X_WB = improved(tag->second * proposal.X_TB);
    const double cost = cost_of(X_WB);
    if (!(cost < best_cost)) continue;
    best = X_WB;
    best_cost = cost;
  }
  return best;
}

bool SettledTrajectory::place_all(const std::vector<CameraMount>& cameras, const TagPoses& map) {
  bool changed = false;
  std::vector<StampedPose> neighbours;
  std::optional<StampedPose> last;
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    Frame& frame = frames_[i];
    neighbours.clear();
    if (last) neighbours.push_back(*last);
    if (i + 1 < frames_.size() && frames_[i + 1].X_WB)
      neighbours.push_back({frames_[i + 1].at, *frames_[i + 1].X_WB});
    const std::optional<Pose> X_WB = place(frame, cameras, map, neighbours);
    if (!X_WB) continue;
    changed = changed || !frame.X_WB || frame.X_WB->p != X_WB->p;
    frame.X_WB = X_WB;
    last = StampedPose{frame.at, *X_WB};
  }
  return changed;
}

Expected<void> SettledTrajectory::refine_all(const SettlingStart& start,
                                             std::vector<KnownTag>& tags) {
  RefinementProblem problem{start.cameras,  {}, start.known, tags, start.priors, corner_noise_px_,
                            start.gauge_tag};
  for (const Frame& frame : frames_)
    if (frame.X_WB) problem.frames.push_back({*frame.X_WB, frame.images});
  auto refined = refine(problem);
  if (!refined) return tl::unexpected(refined.error());
  tags = std::move(refined->tags);
  auto X_WB = refined->X_WB.begin();
  for (Frame& frame : frames_)
    if (frame.X_WB) frame.X_WB = *X_WB++;
  return {};
}

void SettledTrajectory::see_through(int camera, const CameraModel& lens) {
  for (Frame& frame : frames_) {
    for (TagObservations& image : frame.images) {
      if (image.camera != camera) continue;
      std::vector<TagObservation> kept;
      for (TagObservation& tag : image.tags) {
        if (fiducap::see_through(lens, tag)) kept.push_back(tag);
      }
      image.tags = std::move(kept);
    }
  }
}

Expected<Settlement> SettledTrajectory::settle(const SettlingStart& start) {
  Settlement settled{{}, start.estimated, 0};
  const auto map = [&] {
    TagPoses poses;
    for (const std::vector<KnownTag>* tags : {&start.known, &std::as_const(settled.tags)})
      for (const KnownTag& tag : *tags) poses.emplace(tag.tag_id, tag.X_WT);
    return poses;
  };
  for (Frame& frame : frames_) propose_planar_poses(frame, start.cameras);
  bool changed = place_all(start.cameras, map());
  for (int round = 0; round < kRounds && changed; ++round) {
    if (auto refined = refine_all(start, settled.tags); !refined)
      return tl::unexpected(refined.error());
    changed = place_all(start.cameras, map());
  }
  for (const Frame& frame : frames_) {
    if (!frame.X_WB) continue;
    settled.trajectory.push_back({frame.at, *frame.X_WB});
    settled.images += static_cast<int>(frame.images.size());
  }
  return settled;
}

}  // namespace fiducap
