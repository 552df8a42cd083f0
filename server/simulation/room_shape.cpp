#include "simulation/room_shape.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "detection/tag_geometry.hpp"
#include "simulation/random.hpp"

namespace fiducap::simulation {

namespace {

using std::numbers::pi;

// Hall: 10 m by 8 m, 3.5 m high, origin on the floor in its middle.
constexpr double kHallHalfX_m = 5.0;
constexpr double kHallHalfY_m = 4.0;
constexpr double kHallHeight_m = 3.5;

// Loop: the straight legs of the rounded rectangle follow from its length, width and corner radius.
constexpr double kLoopWidth_m = 20.0;
constexpr double kLoopRadius_m = 3.0;
constexpr double kLoopTagDistance_m = 2.0;

RecordedTag tag(int id, double edge, const Eigen::Vector3d& p, const Eigen::Quaterniond& q) {
  return {id, edge, {q.normalized(), p}, 0.0, 0.0};
}

std::vector<RecordedTag> hall(double edge) {
  // Evenly spread over each wall, ids counter-clockwise from tag 0 in the middle of the wall at y =
  // +4. Heights are a low-discrepancy sequence in 1.0..2.2 m: corners of neighbours do not align.
  struct Wall {
    Eigen::Vector3d middle, along, normal;
    double length;
    int tags;
  };
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const std::array<Wall, 4> walls{{{kHallHalfY_m * y, -x, -y, 2 * kHallHalfX_m, 7},
                                   {-kHallHalfX_m * x, -y, x, 2 * kHallHalfY_m, 5},
                                   {-kHallHalfY_m * y, x, y, 2 * kHallHalfX_m, 7},
                                   {kHallHalfX_m * x, y, -x, 2 * kHallHalfY_m, 5}}};
  constexpr int kTags = 24;
  constexpr int kBeforeTag0 = 3;
  std::vector<RecordedTag> tags;
  int place = 0;
  for (const Wall& wall : walls) {
    for (int i = 0; i < wall.tags; ++i, ++place) {
      const int id = (place - kBeforeTag0 + kTags) % kTags;
      const double along = ((i + 0.5) / wall.tags - 0.5) * wall.length;
      const double height = 1.0 + 1.2 * std::fmod(0.5 + id * 0.6180339887, 1.0);
      tags.push_back(tag(id, edge,
                         wall.middle + along * wall.along + height * Eigen::Vector3d::UnitZ(),
                         upright_tag(wall.normal)));
    }
  }
  return tags;
}

std::vector<RecordedTag> table() {
  constexpr double kEdge_m = 0.16;
  const auto turned = [](double angle) { return exp_so3({0, 0, angle}); };
  return {tag(0, kEdge_m, {0, 0, 0}, turned(0)), tag(1, kEdge_m, {0.42, 0.05, 0}, turned(0.3)),
          tag(2, kEdge_m, {0.18, -0.40, 0}, turned(-0.5))};
}

std::vector<RecordedTag> sparse() {
  constexpr double kEdge_m = 0.232;
  struct Place {
    Eigen::Vector3d p;
    double aside, up, roll;  // rotation from the direction to the centre
  };
  const std::array<Place, 3> places{{{{-1.80, 0.70, 1.75}, 0.35, -0.25, 0.15},
                                     {{0.70, 1.90, 1.20}, -0.30, 0.20, -0.10},
                                     {{1.90, -0.60, 0.95}, 0.25, 0.30, 0.20}}};
  std::vector<RecordedTag> tags;
  for (const Place& place : places) {
    const Eigen::Vector3d inward = Eigen::Vector3d(-place.p.x(), -place.p.y(), 0).normalized();
    tags.push_back(tag(static_cast<int>(tags.size()), kEdge_m, place.p,
                       upright_tag(inward) * exp_so3({-place.up, place.aside, place.roll})));
  }
  return tags;
}

std::vector<RecordedTag> loop(const LoopShape& shape) {
  constexpr double kEdge_m = 0.2;
  std::vector<RecordedTag> tags;
  for (int id = 0; id < shape.tags; ++id) {
    Random random(0, Purpose::kRoom, static_cast<std::uint64_t>(id));
    const LoopPoint at = loop_at(shape, id * shape.length_m / shape.tags);
    const Eigen::Vector3d p = at.p + kLoopTagDistance_m * at.outward +
                              random.uniform(-0.35, 0.35) * Eigen::Vector3d::UnitZ();
    tags.push_back(tag(id, kEdge_m, p,
                       upright_tag(-at.outward) * exp_so3({0.1, random.uniform(0.1, 0.5), 0})));
  }
  return tags;
}

std::vector<RecordedTag> ceiling() {
  constexpr double kEdge_m = 0.25;
  constexpr double kHeight_m = 4.2;
  constexpr double kPitch_m = 1.2;
  constexpr int kPerSide = 10;
  const Eigen::Quaterniond downward = exp_so3({pi, 0, 0});
  std::vector<RecordedTag> tags;
  for (int id = 0; id < kPerSide * kPerSide; ++id) {
    Random random(1, Purpose::kRoom, static_cast<std::uint64_t>(id));
    const auto place = [&](int index) {
      return (index - 0.5 * (kPerSide - 1)) * kPitch_m + random.uniform(-0.15, 0.15);
    };
    const double x = place(id % kPerSide);
    const double y = place(id / kPerSide);
    const double z = kHeight_m + random.uniform(-0.3, 0.3);
    const double tilt_x = random.uniform(-0.12, 0.12);
    const double tilt_y = random.uniform(-0.12, 0.12);
    const double turn = random.uniform(-pi, pi);
    tags.push_back(tag(id, kEdge_m, {x, y, z},
                       downward * exp_so3({tilt_x, tilt_y, 0}) * exp_so3({0, 0, turn})));
  }
  return tags;
}

}  // namespace

const std::vector<std::string>& room_presets() {
  static const std::vector<std::string> names{"hall",    "table",    "sparse", "loop",
                                              "ceiling", "pavillon", "ring",   "custom"};
  return names;
}

Eigen::Quaterniond upright_tag(const Eigen::Vector3d& normal) {
  Eigen::Matrix3d R_WT;
  R_WT.col(2) = normal;
  R_WT.col(1) = Eigen::Vector3d::UnitZ();
  R_WT.col(0) = R_WT.col(1).cross(R_WT.col(2));
  return Eigen::Quaterniond(R_WT);
}

std::array<Eigen::Vector3d, 4> corners_of(const RecordedTag& tag) {
  const auto corner = [&](int i) { return tag.X_WT * tag_corner(i, tag.edge_m); };
  return {corner(0), corner(1), corner(2), corner(3)};
}

LoopShape loop_of(const RoomConfig& room) {
  if (room.preset == "ring") return {room.ring.length_m, room.ring.tags};
  return room.preset == "pavillon" ? kPavillon : kLoop;
}

LoopPoint loop_at(const LoopShape& shape, double distance_m) {
  constexpr double kQuarter = 0.5 * pi * kLoopRadius_m;
  constexpr double kAcross = kLoopWidth_m - 2 * kLoopRadius_m;
  const double along = shape.length_m / 2 - 2 * kQuarter - kAcross;
  const std::array<double, 4> legs{kAcross, along, kAcross, along};
  double left = distance_m - shape.length_m * std::floor(distance_m / shape.length_m);
  const double height = 2.9 - 1.3 * std::cos(2 * pi * left / shape.length_m);
  Eigen::Vector3d p(0, 0, height);
  double heading = 0;
  for (std::size_t leg = 0; leg < legs.size(); ++leg) {
    const Eigen::Vector3d ahead(std::cos(heading), std::sin(heading), 0);
    const Eigen::Vector3d right(std::sin(heading), -std::cos(heading), 0);
    if (left <= legs[leg]) return {p + left * ahead, right};
    p += legs[leg] * ahead;
    left -= legs[leg];
    if (left <= kQuarter || leg + 1 == legs.size()) {
      const double turn = left / kLoopRadius_m;
      const Eigen::Vector3d turned_right(std::sin(heading + turn), -std::cos(heading + turn), 0);
      return {p + kLoopRadius_m * (turned_right - right), turned_right};
    }
    p += kLoopRadius_m * (ahead - right);
    heading += 0.5 * pi;
    left -= kQuarter;
  }
  return {p, -Eigen::Vector3d::UnitY()};
}

std::vector<RecordedTag> tags_of(const RoomConfig& room) {
  std::map<int, RecordedTag> by_id;
  std::vector<RecordedTag> preset;
  if (room.preset == "hall") preset = hall(room.tag_size_m);
  if (room.preset == "table") preset = table();
  if (room.preset == "sparse") preset = sparse();
  if (room.preset == "loop" || room.preset == "pavillon" || room.preset == "ring")
    preset = loop(loop_of(room));
  if (room.preset == "ceiling") preset = ceiling();
  for (const RecordedTag& t : preset) by_id[t.tag_id] = t;
  for (RecordedTag t : room.tags) {
    if (t.edge_m == 0) t.edge_m = room.tag_size_m;
    by_id[t.tag_id] = t;
  }
  std::vector<RecordedTag> tags;
  for (const auto& [id, t] : by_id) tags.push_back(t);
  return tags;
}

RoomBox box_of(const RoomConfig& room) {
  if (room.preset == "hall")
    return {{-kHallHalfX_m, -kHallHalfY_m, 0}, {kHallHalfX_m, kHallHalfY_m, kHallHeight_m}};
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(2.5);
  RoomBox box{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  const std::vector<RecordedTag> tags = tags_of(room);
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const Eigen::Vector3d& p = tags[i].X_WT.p;
    box.low = i == 0 ? p : Eigen::Vector3d(box.low.cwiseMin(p));
    box.high = i == 0 ? p : Eigen::Vector3d(box.high.cwiseMax(p));
  }
  box.low -= margin;
  box.high += margin;
  box.low.z() = std::min(box.low.z(), 0.0);  // the floor is at 0 or below
  return box;
}

}  // namespace fiducap::simulation
