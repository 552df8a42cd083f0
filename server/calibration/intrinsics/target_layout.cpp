#include "calibration/intrinsics/target_layout.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "calibration/intrinsics/target_poses.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kProposingViews = 12;  // per pair of targets
constexpr std::size_t kJudgingViews = 24;
constexpr double kLost_px = 40;
constexpr double kAgree_px = 4;

using TargetPair = std::pair<int, int>;

/// A sighting with all poses it allows.
struct Seen {
  const TargetSighting* sighting;
  std::vector<TargetPose> poses;
};

/// Where b stands in the axes of a.
struct Link {
  Pose X_AB;
  double cost{std::numeric_limits<double>::infinity()};
  int support{0};  ///< Images that agree.
};

template <typename T>
std::vector<T> thinned(const std::vector<T>& all, std::size_t count) {
  if (all.size() <= count) return all;
  std::vector<T> some;
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
  return some;
}

class Layout final {
 public:
  Layout(const CalibrationData& data, const CameraModel& camera) : data_(data), camera_(camera) {
    for (const CalibrationView& view : data.views) {
      views_.emplace_back();
      for (const TargetSighting& s : view.sightings)
        views_.back().push_back({&s, poses_of(target(s.target), s, camera)});
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
      const auto judges = thinned(seen, kJudgingViews);
      Link& best = links[pair];
      for (const auto& [a, b] : thinned(seen, kProposingViews))
        for (const TargetPose& X_VA : a->poses)
          for (const TargetPose& X_VB : b->poses) {
            const Link link = judge(X_VA.X_VT.inverse() * X_VB.X_VT, judges);
            if (link.cost < best.cost) best = link;
          }
    }
    return links;
  }

  /// The pose of a group that fits all its targets in a view best.
  [[nodiscard]] std::map<int, Pose> place_groups(std::size_t v,
                                                 const CalibrationState& state) const {
    std::map<int, Pose> out;
    std::map<int, double> costs;
    for (const Seen& proposer : views_[v]) {
      const auto t = static_cast<std::size_t>(proposer.sighting->target);
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
  [[nodiscard]] const CalibrationTarget& target(int t) const {
    return data_.targets[static_cast<std::size_t>(t)];
  }
  [[nodiscard]] double rms(const TargetSighting& sighting, const Pose& X_VT) const {
    return reprojection_rms_px(target(sighting.target), sighting, camera_, X_VT, kLost_px);
  }

  [[nodiscard]] Link judge(const Pose& X_AB,
                           const std::vector<std::pair<const Seen*, const Seen*>>& judges) const {
    Link link{X_AB, 0, 0};
    for (const auto& [a, b] : judges) {
      double least = kLost_px;
      for (const TargetPose& X_VA : a->poses)
        least = std::min(least, rms(*b->sighting, X_VA.X_VT * X_AB));
      for (const TargetPose& X_VB : b->poses)
        least = std::min(least, rms(*a->sighting, X_VB.X_VT * X_AB.inverse()));
      link.cost += least;
      if (least < kAgree_px) ++link.support;
    }
    link.cost /= static_cast<double>(judges.size());
    return link;
  }

  [[nodiscard]] double cost_of(std::size_t v, int group, const Pose& X_VG,
                               const CalibrationState& state) const {
    double cost = 0;
    for (const Seen& seen : views_[v]) {
      const auto t = static_cast<std::size_t>(seen.sighting->target);
      if (state.group_of[t] == group) cost += rms(*seen.sighting, X_VG * state.X_GT[t]);
    }
    return cost;
  }

  const CalibrationData& data_;
  const CameraModel& camera_;
  std::vector<std::vector<Seen>> views_;
};

std::vector<int> count_sightings(const CalibrationData& data) {
  std::vector<int> counts(data.targets.size(), 0);
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& s : view.sightings) ++counts[static_cast<std::size_t>(s.target)];
  return counts;
}

/// Grows a group along the links with the most support. The target that defines a group must be the
/// first of it in order, so groups are named and X_GT are set at the end.
class Tree final {
 public:
  Tree(std::size_t targets, const std::map<TargetPair, Link>& links)
      : links_(links), root_(targets, -1), X_RT_(targets) {}

  void grow(int root) {
    if (root_[static_cast<std::size_t>(root)] >= 0) return;
    root_[static_cast<std::size_t>(root)] = root;
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
      const bool a = root_[static_cast<std::size_t>(pair.first)] == root;
      const bool b = root_[static_cast<std::size_t>(pair.second)] == root;
      if (a == b || link.support == 0 || (best != nullptr && link.support <= best->support))
        continue;
      best = &link;
      at = pair;
    }
    if (best == nullptr) return false;
    const auto a = static_cast<std::size_t>(at.first);
    const auto b = static_cast<std::size_t>(at.second);
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
  for (std::size_t t = 0; t < part.size(); ++t) part[t] = static_cast<int>(t);
  const auto first_of = [&](int t) {
    while (part[static_cast<std::size_t>(t)] != t) t = part[static_cast<std::size_t>(t)];
    return t;
  };
  for (const CalibrationView& view : data.views)
    for (const TargetSighting& a : view.sightings)
      for (const TargetSighting& b : view.sightings) {
        if (state.group_of[static_cast<std::size_t>(a.target)] !=
            state.group_of[static_cast<std::size_t>(b.target)])
          continue;
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
      const auto t = static_cast<std::size_t>(s.target);
      const auto first = static_cast<std::size_t>(part[t]);
      X_VG[v][part[t]] = state.X_VG[v].at(state.group_of[t]) * state.X_GT[first];
    }
  std::vector<Pose> X_GT(state.X_GT.size());
  for (std::size_t t = 0; t < X_GT.size(); ++t)
    X_GT[t] = part[t] == static_cast<int>(t)
                  ? Pose{}
                  : state.X_GT[static_cast<std::size_t>(part[t])].inverse() * state.X_GT[t];
  state.X_VG = std::move(X_VG);
  state.X_GT = std::move(X_GT);
  state.group_of = part;
}

CalibrationState loose_state(CalibrationData& data, const CameraModel& camera) {
  CalibrationState state;
  state.camera = camera;
  state.X_GT.resize(data.targets.size());
  for (std::size_t t = 0; t < data.targets.size(); ++t)
    state.group_of.push_back(static_cast<int>(t));
  for (CalibrationView& view : data.views) {
    auto& poses = state.X_VG.emplace_back();
    std::erase_if(view.sightings, [&](const TargetSighting& s) {
      const auto allowed = poses_of(data.targets[static_cast<std::size_t>(s.target)], s, camera);
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
  for (std::size_t t = 0; t < order.size(); ++t) order[t] = static_cast<int>(t);
  const auto counts = count_sightings(data);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return counts[static_cast<std::size_t>(a)] > counts[static_cast<std::size_t>(b)];
  });
  for (const int root : order) tree.grow(root);
  tree.store(state);
  for (std::size_t v = 0; v < data.views.size(); ++v)
    state.X_VG.push_back(layout.place_groups(v, state));
  return state;
}

}  // namespace fiducap
