#include "mapping/formats/map_doubts.hpp"

#include <algorithm>
#include <cmath>

#include "base/text.hpp"
#include "mapping/formats/text_number.hpp"

namespace fiducap {

namespace {

constexpr double kLargestEdge_m = 10;
constexpr double kSmallestEdge_m = 1e-3;
constexpr double kFarthest_m = 1e6;
constexpr double kFarFromOrigin_m = 1e3;  // more than a hall; metres or millimetres?
constexpr double kBelowFloor_m = -0.05;
constexpr double kNearFloor_m = 0.3;
constexpr double kClearly = 0.7;  // cosine of 45 degrees
constexpr std::size_t kMostNamed = 10;

/// How many of the tags on walls stand on their heads, and of those near the floor look into it.
struct Turned {
  std::size_t on_walls{0};
  std::size_t on_head{0};
  std::size_t on_floor{0};
  std::size_t into_floor{0};
};

Turned turned_of(const TagMap& map) {
  Turned turned;
  for (const MapTag& entry : map.tags) {
    const Eigen::Matrix3d R_WT = entry.tag.X_WT.rotation();
    if (std::abs(R_WT(2, 2)) < 1 - kClearly) {
      ++turned.on_walls;
      turned.on_head += R_WT(2, 1) < -kClearly ? 1 : 0;
    } else if (std::abs(R_WT(2, 2)) > kClearly && entry.tag.X_WT.p.z() < kNearFloor_m) {
      ++turned.on_floor;
      turned.into_floor += R_WT(2, 2) < 0 ? 1 : 0;
    }
  }
  return turned;
}

template <typename Measure>
const MapTag& most_of(const TagMap& map, Measure measure) {
  return *std::max_element(map.tags.begin(), map.tags.end(), [&](const MapTag& a, const MapTag& b) {
    return measure(a) < measure(b);
  });
}

std::string all_of(std::size_t count) { return "all " + std::to_string(count) + " tags "; }

}  // namespace

std::optional<std::string> unit_fault_of_edge(double edge_m) {
  if (edge_m > kLargestEdge_m) {
    return "edge is " + to_text(edge_m) +
           " m: must be at most 10; sizes are in metres, 160 mm is "
           "0.16";
  }
  if (edge_m > 0 && edge_m < kSmallestEdge_m) {
    return "edge is " + to_text(edge_m) + " m: must be at least 0.001; sizes are in metres";
  }
  return std::nullopt;
}

std::optional<std::string> unit_fault_in(const KnownTag& tag) {
  if (auto fault = unit_fault_of_edge(tag.edge_m)) return fault;
  return unit_fault_of_place(tag.X_WT.p);
}

std::optional<std::string> unit_fault_of_place(const Eigen::Vector3d& p_WT) {
  if (p_WT.lpNorm<Eigen::Infinity>() <= kFarthest_m) return std::nullopt;
  return "position must be finite and within 1000 km of the origin";
}

std::vector<std::string> doubts_about(const TagMap& map) {
  std::vector<std::string> doubts;
  if (map.tags.empty()) return doubts;
  const auto height = [](const MapTag& entry) { return entry.tag.X_WT.p.z(); };
  const auto distance = [](const MapTag& entry) { return entry.tag.X_WT.p.norm(); };
  const MapTag& highest = most_of(map, height);
  if (map.tags.size() > 1 && height(highest) < kBelowFloor_m) {
    doubts.push_back(all_of(map.tags.size()) + "lie below z = 0, the highest at " +
                     fixed(height(highest), 2) + " m: is z up in this file?");
  }
  const MapTag& farthest = most_of(map, distance);
  if (distance(farthest) > kFarFromOrigin_m) {
    doubts.push_back("tag " + std::to_string(farthest.tag.tag_id) + " is " +
                     fixed(distance(farthest), 0) +
                     " m from the origin: are the positions in metres?");
  }
  const Turned turned = turned_of(map);
  if (turned.on_walls > 1 && turned.on_head == turned.on_walls) {
    doubts.push_back(all_of(turned.on_walls) +
                     "on walls stand on their heads: does this file count y down and z into the "
                     "tag, as libapriltag does?");
  }
  if (turned.on_floor > 1 && turned.into_floor == turned.on_floor) {
    doubts.push_back(all_of(turned.on_floor) +
                     "that lie flat near z = 0 look down: does this file count z into the tag, or "
                     "z down?");
  }
  return doubts;
}

std::string tags_text(const std::vector<int>& ids) {
  std::string text = ids.size() == 1 ? "tag " : "tags ";
  const std::size_t named = std::min(ids.size(), kMostNamed);
  for (std::size_t i = 0; i < named; ++i) {
    const bool is_last = i + 1 == ids.size();
    text += (i == 0 ? "" : is_last ? " and " : ", ") + std::to_string(ids[i]);
  }
  if (ids.size() > named) text += " and " + std::to_string(ids.size() - named) + " more";
  return text;
}

}  // namespace fiducap
