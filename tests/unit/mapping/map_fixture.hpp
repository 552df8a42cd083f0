#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "base/pose.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// 0 … count - 1.
inline std::vector<int> first_ids(int count) {
  std::vector<int> ids(static_cast<std::size_t>(count));
  std::iota(ids.begin(), ids.end(), 0);
  return ids;
}

/// A map with tags `ids` (sorted), each with another pose, with full covariance and history.
inline TagMap make_map(const std::vector<int>& ids) {
  TagMap map;
  map.X_RW = {exp_so3({0, 0, 0.25}), {10.5, -3.25, 0.125}};
  map.created_utc_ns = 1'700'000'000'123'456'789;
  for (const int id : ids) {
    const double k = id;
    MapTag entry;
    entry.tag.tag_id = id;
    entry.tag.edge_m = 0.16 + 0.01 * k;
    entry.tag.X_WT = {exp_so3({0.1 * k, -0.3, 1.0 / (k + 1)}), {k / 3.0, -k / 7.0, 1.5 + 0.1 * k}};
    const Matrix6d A = Matrix6d::Identity() + Matrix6d::Constant(0.1 / (k + 1));
    entry.tag.covariance = 1e-6 * A * A.transpose();
    entry.state = TagState::kCalibrated;
    entry.first_seen_utc_ns = 1'699'999'999'000'000'001;
    entry.last_seen_utc_ns = 1'700'000'000'000'000'003;
    entry.sightings = 100 + id;
    map.tags.push_back(entry);
  }
  return map;
}

/// With correlations of each tag and the next one.
inline TagMap with_ties(TagMap map) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> gauss;
  auto known = std::make_shared<KnownMap>();
  known->revision = 7;
  for (const MapTag& entry : map.tags) known->tags.push_back(entry.tag);
  for (std::size_t i = 0; i + 1 < map.tags.size(); ++i) {
    KnownPair pair{map.tags[i].tag.tag_id, map.tags[i + 1].tag.tag_id, {}};
    for (double& x : std::span(pair.covariance.data(), pair.covariance.size()))
      x = 1e-6 * gauss(random);
    known->pairs.push_back(pair);
  }
  map.known = std::move(known);
  return map;
}

/// Tags with random poses, of 5 cm and more; exact.
inline TagMap random_map(unsigned seed, int tags = 50) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  TagMap map;
  for (int id = 0; id < tags; ++id) {
    MapTag entry;
    entry.tag.tag_id = 3 * id;
    entry.tag.edge_m = 0.05 + std::abs(normal(random));
    entry.tag.X_WT.q =
        Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
            .normalized();
    entry.tag.X_WT.p = {100 * normal(random), 100 * normal(random), normal(random) * 1e-7};
    map.tags.push_back(entry);
  }
  return map;
}

/// Corner i in tag axes (x right, y up, z out of the face): bottom-left, bottom-right, top-right,
/// top-left.
inline Eigen::Vector3d printed_corner(int i, double edge_m) {
  const double h = 0.5 * edge_m;
  return {i == 1 || i == 2 ? h : -h, i >= 2 ? h : -h, 0};
}

/// Distance of a tag's printed corner from a point.
inline double corner_off_m(const KnownTag& tag, int corner, const Eigen::Vector3d& expected) {
  return (tag.X_WT * printed_corner(corner, tag.edge_m) - expected).norm();
}

/// The largest distance between equal corners of equal tags, metres; infinite when the ids differ.
inline double worst_corner_m(const TagMap& a, const TagMap& b) {
  if (a.tags.size() != b.tags.size()) return std::numeric_limits<double>::infinity();
  double worst = 0;
  for (const MapTag& entry : a.tags) {
    const MapTag* other = b.find(entry.tag.tag_id);
    if (other == nullptr) return std::numeric_limits<double>::infinity();
    for (int i = 0; i < 4; ++i)
      worst = std::max(worst, corner_off_m(entry.tag, i,
                                           other->tag.X_WT * printed_corner(i, other->tag.edge_m)));
  }
  return worst;
}

}  // namespace fiducap
