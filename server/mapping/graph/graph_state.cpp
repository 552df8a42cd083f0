#include "mapping/graph/graph_state.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "estimation/filter/heading_rule.hpp"
#include "estimation/world/filter_state.hpp"

namespace fiducap {

namespace {

using segment_layout::kCameraSize;
using segment_layout::kClock;

// Sigmas of a parameter that is wrong, as in CalibrationMonitor.
constexpr double kOpenMount = 0.05;  // m and rad
constexpr double kOpenReadout_s = 0.02;
constexpr double kOpenFocal = 0.05;
constexpr double kOpenCentre_px = 20.0;
constexpr double kOpenDistortion = 0.1;
// A larger change of a clock, when a body is found again, is a jump …
constexpr double kJumped_s = 0.01;
// … whose size is known this well when a chain begins.
constexpr double kJumpFound_s = 0.03;

double inverse_square(double sigma) { return 1.0 / (sigma * sigma); }

Eigen::Index row_of(std::size_t camera) { return static_cast<Eigen::Index>(camera) * kCameraSize; }

/// The configured sigma, unless it is 0; then that of an open or an exact parameter.
double sigma_of(double configured, bool is_open, double open) {
  return configured > 0 ? configured : (is_open ? open : kExactSigma);
}

/// Information of the prior of all cameras' parameters.
Eigen::MatrixXd information_of(const GraphBody& body) {
  using namespace segment_layout;  // NOLINT: the block names are the subject
  const SegmentSensors& sensors = *body.sensors;
  const Eigen::Index rows = row_of(sensors.cameras.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(rows, rows);
  for (std::size_t c = 0; c < sensors.cameras.size(); ++c) {
    const CameraMount& mount = sensors.cameras[c];
    const auto is_open = [&](FoundMismatch::Kind kind) {
      return body.open.contains({kind, static_cast<int>(c)});
    };
    const auto of_mount = [&](double configured) {
      if (is_open(FoundMismatch::Kind::kMountPosition)) return kOpenMount;
      return sensors.estimates_extrinsics ? std::max(kExactSigma, configured) : kExactSigma;
    };
    Vector6d plain;
    plain.head<3>().setConstant(inverse_square(of_mount(mount.position_sigma_m)));
    plain.tail<3>().setConstant(inverse_square(of_mount(mount.rotation_sigma_rad)));
    const Matrix6d J = world::plain_from_world_error(mount.X_BV.p);
    out.block<6, 6>(row_of(c), row_of(c)) = J.transpose() * plain.asDiagonal() * J;
    const bool has_clock = sensors.estimates_clocks && sensors.has_imu;
    const bool lens = is_open(FoundMismatch::Kind::kLens);
    Eigen::Matrix<double, kCameraSize - kClock, 1> sigmas;
    sigmas << (has_clock ? std::max(kExactSigma, mount.time_shift_sigma_s) : kExactSigma),
        sigma_of(has_clock ? mount.readout_sigma_s : 0, is_open(FoundMismatch::Kind::kReadout),
                 kOpenReadout_s),
        sigma_of(mount.focal_sigma, lens, kOpenFocal),
        sigma_of(mount.centre_sigma_px, lens, kOpenCentre_px),
        sigma_of(mount.centre_sigma_px, lens, kOpenCentre_px),
        sigma_of(mount.k1_sigma, lens, kOpenDistortion);
    out.diagonal().segment(row_of(c) + kClock, sigmas.size()) = sigmas.cwiseAbs2().cwiseInverse();
  }
  return out;
}

/// Connected sets of a component's nodes and tags, by segments and the prior (union-find).
class Islands final {
 public:
  Islands(const GraphState& graph, int component)
      : nodes_(graph.nodes.size()), parent_(nodes_ + graph.tags.size()) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    for (const GraphSegment& segment : graph.segments) {
      if (graph.nodes[segment.begin].component != component) continue;
      join(segment.begin, segment.end);
      for (const std::size_t i : segment.tags) join(segment.begin, nodes_ + i);
    }
    for (const std::size_t i : graph.prior.tags)
      join(nodes_ + graph.prior.tags.front(), nodes_ + i);
  }
  [[nodiscard]] std::size_t of_node(std::size_t i) { return root(i); }
  [[nodiscard]] std::size_t of_tag(std::size_t i) { return root(nodes_ + i); }

 private:
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[root(a)] = root(b); }

  std::size_t nodes_;
  std::vector<std::size_t> parent_;
};

/// Removes nodes of no segment, with the starts of their chains.
std::vector<std::optional<std::size_t>> forget_bare_nodes(GraphState& graph) {
  std::vector<std::optional<std::size_t>> now(graph.nodes.size());
  for (const GraphSegment& segment : graph.segments) now[segment.begin] = now[segment.end] = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    if (!now[i]) continue;
    now[i] = count;
    graph.nodes[count++] = graph.nodes[i];
  }
  graph.nodes.resize(count);
  for (GraphSegment& segment : graph.segments) {
    segment.begin = *now[segment.begin];
    segment.end = *now[segment.end];
  }
  std::erase_if(graph.starts, [&](const ChainStart& start) { return !now[start.node]; });
  for (ChainStart& start : graph.starts) {
    start.node = *now[start.node];
    if (start.after < 0) continue;
    const auto after = now[static_cast<std::size_t>(start.after)];
    start.after = after ? static_cast<int>(*after) : -1;
  }
  return now;
}

/// Of a chain that begins with this segment since the one before was removed.
ChainStart start_of(const GraphSegment& segment, const GraphState& graph) {
  const GraphNode& node = graph.nodes[segment.begin];
  ChainStart out{.node = segment.begin, .has_imu = segment.raw.has_imu()};
  if (!out.has_imu && graph.level.at(node.component))  // level by odometry
    out.up_B = node.at.X_WB.q.conjugate() * Eigen::Vector3d::UnitZ();
  return out;
}

}  // namespace

// --- bodies ---

GraphBody body_by_configuration(int id, std::shared_ptr<const SegmentSensors> sensors) {
  GraphBody body;
  body.id = id;
  for (const CameraMount& mount : sensors->cameras)
    body.expected.push_back({.X_BV = mount.X_BV,
                             .shift_s = 0,
                             .readout_s = mount.readout_s,
                             .rows_apart = mount.readout_s != 0 || mount.readout_sigma_s != 0,
                             .lens = {}});
  body.cameras = body.expected;
  body.sensors = std::move(sensors);
  body.information = information_of(body);
  return body;
}

bool clock_has_jumped(const GraphBody& body, const MotionSegment& segment) {
  for (std::size_t c = 0; c < body.cameras.size(); ++c)
    if (std::abs(segment.cameras[c].shift_s - body.cameras[c].shift_s) > kJumped_s) return true;
  return false;
}

GraphBody after_clock_jump(const GraphBody& before, int index, const MotionSegment& since) {
  GraphBody body = before;
  body.same_as = index;
  body.information.setZero();
  for (std::size_t c = 0; c < body.cameras.size(); ++c) {
    body.cameras[c].shift_s = body.expected[c].shift_s = since.cameras[c].shift_s;
    const double sigma = since.sensors->cameras[c].time_shift_sigma_s;
    body.information(row_of(c) + kClock, row_of(c) + kClock) =
        inverse_square(std::max(kJumpFound_s, sigma));
  }
  return body;
}

SameNumbers information_of_same() {
  SameNumbers sigma;
  sigma << 1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5,  // m and rad
      1, 1e-6,                                  // s
      1e-6, 1e-3, 1e-3, 1e-6;
  SameNumbers out = sigma.cwiseAbs2().cwiseInverse();
  out(kClock) = 0;
  return out;
}

void initialise_cameras(const std::vector<CameraBelief>& found, GraphBody& body) {
  body.cameras = found;
  for (std::size_t c = 0; c < found.size(); ++c) body.expected[c].shift_s = found[c].shift_s;
}

void open_parameters(const OpenParameters& open, std::size_t body, GraphState& graph) {
  GraphBody& own = graph.bodies[body];
  own.open = open;
  const Eigen::MatrixXd before = std::exchange(own.information, information_of(own));
  if (body >= graph.prior.cameras.size()) return;
  Eigen::Index at = 0;
  for (std::size_t b = 0; b < body; ++b) at += graph.bodies[b].information.rows();
  graph.prior.camera_information.block(at, at, before.rows(), before.cols()) +=
      own.information - before;
}

std::size_t first_of(std::size_t body, const GraphState& graph) {
  while (graph.bodies[body].same_as >= 0)
    body = static_cast<std::size_t>(graph.bodies[body].same_as);
  return body;
}

MotionSegment segment_now(const GraphState& graph, const GraphSegment& segment) {
  MotionSegment now = segment.raw;
  const BodyMoment& begin = graph.nodes[segment.begin].at;
  const Pose G = axes_between(now.begin().X_WB, begin.X_WB, now.has_imu());
  for (MotionSegment::Instance& instance : now.instances)
    instance.body = in_other_axes(G, instance.body);
  now.instances.front().body = begin;
  now.instances.back().body = graph.nodes[segment.end].at;
  const auto body = static_cast<std::size_t>(graph.nodes[segment.begin].body);
  now.cameras = graph.bodies[body].cameras;
  now.scales.resize(segment.tags.size());
  for (std::size_t i = 0; i < segment.tags.size(); ++i) {
    const GraphTag& tag = graph.tags[segment.tags[i]];
    now.tags[i].X_WT = tag.X_WT;
    now.scales[i] = graph.common_scale + tag.scale;
  }
  now.gravity_offset_m_s2 = graph.gravity_offset_m_s2;
  now.imu = graph.bodies[first_of(body, graph)].imu;
  return now;
}

// --- components ---

void move_component(int component, const Pose& T, GraphState& graph) {
  for (GraphNode& node : graph.nodes)
    if (node.component == component) node.at = in_other_axes(T, node.at);
  for (GraphTag& tag : graph.tags)
    if (tag.component == component) tag.X_WT = T * tag.X_WT;
  if (component == kInWorkspace) graph.prior.move(T);
}

void merge_components(int from, int into, const Pose& T, GraphState& graph) {
  move_component(from, T, graph);
  for (GraphNode& node : graph.nodes)
    if (node.component == from) node.component = into;
  for (GraphTag& tag : graph.tags)
    if (tag.component == from) tag.component = into;
  graph.level[into] = graph.level[into] || graph.level[from];
  graph.level.erase(from);
  unite_tags(into, graph);
}

void unite_tags(int component, GraphState& graph) {
  std::vector<GraphTag> kept;
  std::map<std::pair<int, int>, std::size_t> numbers;  // by id and epoch, of the component's
  std::vector<std::size_t> now(graph.tags.size());
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    const GraphTag& tag = graph.tags[i];
    now[i] = kept.size();
    if (tag.component == component)
      now[i] = numbers.try_emplace({tag.tag_id, tag.epoch}, kept.size()).first->second;
    if (now[i] == kept.size()) {
      kept.push_back(tag);
      continue;
    }
    GraphTag& one = kept[now[i]];
    if (tag.scale_is_open && !one.scale_is_open) one.scale = tag.scale;
    one.scale_is_open |= tag.scale_is_open;
    one.sightings += tag.sightings;
    one.sightings_before += tag.sightings_before;
    one.first_seen = std::min(one.first_seen, tag.first_seen);
    one.last_seen = std::max(one.last_seen, tag.last_seen);
  }
  graph.tags = std::move(kept);
  renumber_tags(now, graph);
}

void renumber_tags(const std::vector<std::size_t>& now, GraphState& graph) {
  graph.prior.renumber(now);
  for (GraphSegment& segment : graph.segments)
    for (std::size_t& i : segment.tags) i = now[i];
}

void forget_unseen_tags(GraphState& graph) {
  std::vector<bool> is_seen(graph.tags.size());
  for (const GraphSegment& segment : graph.segments)
    for (const std::size_t i : segment.tags) is_seen[i] = true;
  for (const std::size_t i : graph.prior.tags) is_seen[i] = true;
  std::vector<std::size_t> now(graph.tags.size());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    now[i] = kept;
    if (is_seen[i]) graph.tags[kept++] = graph.tags[i];
  }
  graph.tags.resize(kept);
  renumber_tags(now, graph);
}

int split_component(int component, int next, GraphState& graph) {
  Islands islands(graph, component);
  std::map<std::size_t, int> sightings;  // by island
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    if (graph.tags[i].component == component)
      sightings[islands.of_tag(i)] += graph.tags[i].sightings;
  }
  if (sightings.empty()) return next;
  const auto most = std::ranges::max_element(
      sightings, [](const auto& a, const auto& b) { return a.second < b.second; });
  std::map<std::size_t, int> numbers{{most->first, component}};
  const auto number_of = [&](std::size_t island) {
    const auto [at, is_new] = numbers.try_emplace(island, next);
    if (is_new) graph.level[next++] = graph.level.at(component);
    return at->second;
  };
  for (std::size_t i = 0; i < graph.tags.size(); ++i) {
    if (graph.tags[i].component == component)
      graph.tags[i].component = number_of(islands.of_tag(i));
  }
  for (std::size_t i = 0; i < graph.nodes.size(); ++i) {
    if (graph.nodes[i].component == component)
      graph.nodes[i].component = number_of(islands.of_node(i));
  }
  return next;
}

std::vector<std::optional<std::size_t>> keep_segments(
    const std::function<bool(const GraphSegment&)>& is_kept, GraphState& graph) {
  std::erase_if(graph.segments, [&](const GraphSegment& segment) { return !is_kept(segment); });
  const auto now = forget_bare_nodes(graph);
  std::set<std::size_t> bound;  // nodes with information about velocity and biases
  for (const ChainStart& start : graph.starts) bound.insert(start.node);
  for (const GraphSegment& segment : graph.segments) bound.insert(segment.end);
  for (const GraphSegment& segment : graph.segments)
    if (!bound.contains(segment.begin)) graph.starts.push_back(start_of(segment, graph));
  return now;
}

std::vector<std::optional<std::size_t>> forget_unbound_paths(GraphState& graph) {
  std::set<int> bound;
  for (const GraphTag& tag : graph.tags) bound.insert(tag.component);
  return keep_segments(
      [&](const GraphSegment& s) { return bound.contains(graph.nodes[s.begin].component); }, graph);
}

}  // namespace fiducap
