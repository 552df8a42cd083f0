#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "calibration/intrinsics/initial_state.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kProposalViews = 12;  // per pair of targets
constexpr std::size_t kTestViews = 24;
constexpr double kLost_px = 40;
constexpr double kAgree_px = 4;

using TargetPair = std::pair<int, int>;

/// A sighting with its possible poses.
struct Seen {
  const TargetSighting* sighting;
  std::vector<TargetPose> poses;
};

/// Pose of target b in the axes of target a.
struct Link {
  Pose X_AB;
  double cost{std::numeric_limits<double>::infinity()};
  int support{0};  ///< Number of images that agree.
};

class Layout final {
 public:
  Layout(const CalibrationData& data, const CameraModel& camera) : data_(data), camera_(camera) {
    for (const CalibrationView& view : data.views) {
      views_.emplace_back();
      for (const TargetSighting& s : view.sightings)
        views_.back().push_back({&s, poses_of(data.target_of(s), s, camera)});
    }
  }

  [[nodiscard]] std::map<TargetPair, Link> links() const {
    std::map<TargetPair, std::vector<std::pair<const Seen*, const Seen*>>> together;
    for (const auto& view : views_)
      for (const Seen& a : view)
        for (const Seen& b : view)
          if (a.sighting->target < b.sighting->target && !a.poses.empty() && !b.poses.empty())
            together[{a.sighting->target, b.sighting->target}].emplace_back(&a, &b);
    std::map<TargetPair, Link> links;
    for (const auto& [pair, seen] : together) {
      const auto tests = thinned(seen, kTestViews);
      Link& best = links[pair];
      for (const auto& [a, b] : thinned(seen, kProposalViews))
        for (const TargetPose& X_VA : a->poses)
          for (const TargetPose& X_VB : b->poses) {
            const Link link = test_link(X_VA.X_VT.inverse() * X_VB.X_VT, tests);
            if (link.cost < best.cost) best = link;
          }
    }
    return links;
  }

  /// Per group the pose that fits all its targets in a view best.
  [[nodiscard]] std::map<int, Pose> place_groups(std::size_t v,
                                                 const CalibrationState& state) const {
    std::map<int, Pose> out;
    std::map<int, double> costs;
    for (const Seen& proposer : views_[v]) {
      const auto t = to_index(proposer.sighting->target);
      const int group = state.group_of[t];
      for (const TargetPose& pose : proposer.poses) {
        const Pose X_VG = pose.X_VT * state.X_GT[t].inverse();
        const double cost = cost_of(v, group, X_VG, state);
        if (const auto known = costs.find(group); known != costs.end() && known->second <= cost)
          continue;
        costs[group] = cost;
        out[group] = X_VG;
      }
    }
    return out;
  }

 private:
  [[nodiscard]] double rms(const TargetSighting& sighting, const Pose& X_VT) const {
    return reprojection_rms_px(data_.target_of(sighting), sighting, camera_, X_VT, kLost_px);
  }

  [[nodiscard]] Link test_link(
      const Pose& X_AB, const std::vector<std::pair<const Seen*, const Seen*>>& tests) const {
    Link link{X_AB, 0, 0};
    for (const auto& [a, b] : tests) {
      double least = kLost_px;
      for (const TargetPose& X_VA : a->poses)
        least = std::min(least, rms(*b->sighting, X_VA.X_VT * X_AB));
      for (const TargetPose& X_VB : b->poses)
        least = std::min(least, rms(*a->sighting, X_VB.X_VT * X_AB.inverse()));
      link.cost += least;
      if (least < kAgree_px) ++link.support;
    }
    link.cost /= static_cast<double>(tests.size());
    return link;
  }

  [[nodiscard]] double cost_of(std::size_t v, int group, const Pose& X_VG,
                               const CalibrationState& state) const {
    double cost = 0;
    for (const Seen& seen : views_[v]) {
      const auto t = to_index(seen.sighting->target);
      if (state.group_of[t] == group) cost += rms(*seen.sighting, X_VG * state.X_GT[t]);
    }
    return cost;
  }

  const CalibrationData& data_;
  const CameraModel& camera_;
  std::vector<std::vector<Seen>> views_;
};

/// Grows groups along the links with the most support. A group is defined by its first target in
/// order; therefore store() computes names and X_GT at the end.
class Tree final {
 public:
  Tree(std::size_t targets, const std::map<TargetPair, Link>& links)
      : links_(links), root_(targets, -1), X_RT_(targets) {}

  void grow(int root) {
    if (root_[to_index(root)] >= 0) return;
    root_[to_index(root)] = root;
    while (extend(root)) {
    }
  }

  void store(CalibrationState& state) const {
    for (std::size_t t = 0; t < root_.size(); ++t) {
      const auto first =
          static_cast<std::size_t>(std::find(root_.begin(), root_.end(), root_[t]) - root_.begin());
      state.group_of[t] = static_cast<int>(first);
      state.X_GT[t] = first == t ? Pose{} : X_RT_[first].inverse() * X_RT_[t];
    }
  }

 private:
  bool extend(int root) {
    const Link* best = nullptr;
    TargetPair at;
    for (const auto& [pair, link] : links_) {
      const bool a = root_[to_index(pair.first)] == root;
      const bool b = root_[to_index(pair.second)] == root;
      if (a == b || link.support == 0 || (best != nullptr && link.support <= best->support))
        continue;
      best = &link;
      at = pair;
    }
    if (best == nullptr) return false;
    const auto a = to_index(at.first);
    const auto b = to_index(at.second);
    if (root_[a] == root)
      X_RT_[b] = X_RT_[a] * best->X_AB;
    else
      X_RT_[a] = X_RT_[b] * best->X_AB.inverse();
    root_[a] = root_[b] = root;
    return true;
  }

  const std::map<TargetPair, Link>& links_;
  std::vector<int> root_;  ///< -1: in no group yet.
  std::vector<Pose> X_RT_;
};

/// The first target, in order, of each target's connected part.
std::vector<int> connected_parts(const CalibrationData& data, const CalibrationState& state) {
  std::vector<int> part(state.group_of.size());
  std::iota(part.begin(), part.end(), 0);
  const auto first_of = [&](int t) {
    while (part[to_index(t)] != t) t = part[to_index(t)];
    return t;
  };
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& a : view.sightings)
      for (const TargetSighting& b : view.sightings) {
        if (state.group(a) != state.group(b)) continue;
        const int i = first_of(a.target);
        const int j = first_of(b.target);
        part[static_cast<std::size_t>(std::max(i, j))] = std::min(i, j);
      }
  for (std::size_t t = 0; t < part.size(); ++t) part[t] = first_of(static_cast<int>(t));
  return part;
}

}  // namespace

void split_groups(const CalibrationData& data, CalibrationState& state) {
  const std::vector<int> part = connected_parts(data, state);
  std::vector<std::map<int, Pose>> X_VG(state.X_VG.size());
  for (std::size_t v = 0; v < data.views.size(); ++v)
    for (const TargetSighting& s : data.views[v].sightings) {
      const auto t = to_index(s.target);
      const auto first = to_index(part[t]);
      X_VG[v][part[t]] = state.X_VG[v].at(state.group_of[t]) * state.X_GT[first];
    }
  std::vector<Pose> X_GT(state.X_GT.size());
  for (std::size_t t = 0; t < X_GT.size(); ++t)
    X_GT[t] = part[t] == static_cast<int>(t)
                  ? Pose{}
                  : state.X_GT[to_index(part[t])].inverse() * state.X_GT[t];
  state.X_VG = std::move(X_VG);
  state.X_GT = std::move(X_GT);
  state.group_of = part;
}

CalibrationState separate_state(CalibrationData& data, const CameraModel& camera) {
  CalibrationState state;
  state.camera = camera;
  state.X_GT.resize(data.targets.size());
  state.group_of.resize(data.targets.size());
  std::iota(state.group_of.begin(), state.group_of.end(), 0);
  for (CalibrationView& view : data.views) {
    auto& poses = state.X_VG.emplace_back();
    std::erase_if(view.sightings, [&](const TargetSighting& s) {
      const auto allowed = poses_of(data.targets[to_index(s.target)], s, camera);
      if (!allowed.empty()) poses[s.target] = allowed.front().X_VT;
      return allowed.empty();
    });
  }
  return state;
}

CalibrationState joined_state(const CalibrationData& data, const CameraModel& camera) {
  CalibrationState state;
  state.camera = camera;
  state.X_GT.resize(data.targets.size());
  state.group_of.resize(data.targets.size());
  const Layout layout(data, camera);
  const auto links = layout.links();
  Tree tree(data.targets.size(), links);
  std::vector<int> order(data.targets.size());
  std::iota(order.begin(), order.end(), 0);
  const auto counts = count_sightings(data);
  std::ranges::stable_sort(order,
                           [&](int a, int b) { return counts[to_index(a)] > counts[to_index(b)]; });
  for (const int root : order) tree.grow(root);
  tree.store(state);
  for (std::size_t v = 0; v < data.views.size(); ++v)
    state.X_VG.push_back(layout.place_groups(v, state));
  return state;
}

}  // namespace fiducap
