#include "mapping/map_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>

#include "base/text.hpp"
#include "mapping/graph/graph_datum.hpp"

namespace fiducap {

namespace {

using Points = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;  // W, R

// Seen from above: nearer together they say nothing about heading.
constexpr double kLeastSpread_m = 0.1;
// Distances that differ from the map's by more than this factor are in another unit.
constexpr double kOtherUnit = 5;

std::string tag_name(int tag_id) { return "tag " + std::to_string(tag_id); }

Expected<const MapTag*> usable(const TagMap& map, int tag_id) {
  const MapTag* entry = map.find(tag_id);
  if (entry == nullptr)
    return fail(ErrorCode::kNotFound, tag_name(tag_id) + " is not in version " +
                                          std::to_string(map.version) + " of the map");
  if (entry->component != 0)
    return fail(ErrorCode::kInvalid,
                tag_name(tag_id) + " is not tied to the workspace by any sighting");
  if (entry->state == TagState::kQuarantined)
    return fail(ErrorCode::kInvalid, tag_name(tag_id) + " is quarantined: its place is not known");
  return entry;
}

double worst_of(const Points& points, const Pose& X_RW) {
  double worst = 0;
  for (const auto& [p_W, p_R] : points) worst = std::max(worst, (p_R - X_RW * p_W).norm());
  return worst;
}

/// Root of the mean square from their middle. @param axes  2: seen from above
double spread(const Points& points, bool in_room, int axes = 3) {
  const auto number = static_cast<double>(points.size());
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [p_W, p_R] : points) middle += (in_room ? p_R : p_W) / number;
  double square = 0;
  for (const auto& [p_W, p_R] : points)
    square += ((in_room ? p_R : p_W) - middle).head(axes).squaredNorm() / number;
  return std::sqrt(square);
}

/// The place without which the others agree best.
std::size_t most_contradicting(const Points& points) {
  std::size_t found = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    Points others = points;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const double worst = worst_of(others, lay_over(others));
    if (worst < least) {
      least = worst;
      found = i;
    }
  }
  return found;
}

/// Which axis has to be turned round for the places to fit; empty: none helps.
std::string mirrored_axis(const Points& points, double most_off_m) {
  for (int axis = 0; axis < 3; ++axis) {
    Points turned = points;
    for (auto& [p_W, p_R] : turned) p_R[axis] = -p_R[axis];
    if (worst_of(turned, lay_over(turned)) > most_off_m) continue;
    return axis == 2 ? "z points down" : "x and y are left-handed";
  }
  return {};
}

Expected<Points> points_of(const TagMap& map, std::span<const MeasuredPlace> places) {
  Points points;
  std::set<int> ids;
  for (const MeasuredPlace& place : places) {
    const auto entry = usable(map, place.tag_id);
    if (!entry) return tl::unexpected(entry.error());
    if (!ids.insert(place.tag_id).second)
      return fail(ErrorCode::kInvalid, tag_name(place.tag_id) + " is there twice");
    if (!place.p_RT.allFinite())
      return fail(ErrorCode::kInvalid,
                  "the place of " + tag_name(place.tag_id) + " must be finite");
    points.emplace_back((*entry)->tag.X_WT.p, place.p_RT);
  }
  if (points.size() < 3)
    return fail(ErrorCode::kInvalid, "needs the measured places of three tags or more, has " +
                                         std::to_string(points.size()));
  if (spread(points, false, 2) < kLeastSpread_m)
    return fail(ErrorCode::kInvalid,
                "these tags are above each other: they do not say where the room's x points");
  return points;
}

/// @pre the places do not fit
Error what_is_wrong(std::span<const MeasuredPlace> places, const Points& points,
                    double most_off_m) {
  const double scale = spread(points, true) / spread(points, false);
  if (scale > kOtherUnit || scale < 1 / kOtherUnit)
    return {ErrorCode::kInvalid,
            "the measured places are " + fixed(scale, scale > 1 ? 0 : 4) +
                " times as far apart as the map has the tags: metres are expected",
            {}};
  const std::size_t worst = most_contradicting(points);
  if (const std::string axis = mirrored_axis(points, most_off_m); !axis.empty())
    return {ErrorCode::kInvalid,
            "the room is mirrored, " + axis + " (" + tag_name(places[worst].tag_id) +
                " shows it): axes must be right-handed, z up",
            {}};
  Points others = points;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(worst));
  const Pose X_RW = lay_over(others);
  const double off_m = (points[worst].second - X_RW * points[worst].first).norm();
  return {ErrorCode::kInvalid,
          "the place of " + tag_name(places[worst].tag_id) + " contradicts the others: it is " +
              fixed(1e3 * off_m, 0) + " mm from where they have it, more than " +
              fixed(1e3 * most_off_m, 0) + " mm",
          {}};
}

}  // namespace

Expected<MapAlignment> align(const TagMap& map, std::span<const MeasuredPlace> places,
                             double most_off_m) {
  const auto points = points_of(map, places);
  if (!points) return tl::unexpected(points.error());
  MapAlignment out{.X_RW = lay_over(*points), .residuals = {}};
  if (worst_of(*points, out.X_RW) > most_off_m)
    return tl::unexpected(what_is_wrong(places, *points, most_off_m));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto& [p_W, p_R] = (*points)[i];
    out.residuals.push_back({places[i].tag_id, p_R - out.X_RW * p_W});
  }
  return out;
}

Expected<TagDistance> distance_between(const TagMap& map, int first_id, int second_id) {
  if (first_id == second_id)
    return fail(ErrorCode::kInvalid,
                "a distance needs two tags, " + tag_name(first_id) + " is there twice");
  const auto first = usable(map, first_id);
  if (!first) return tl::unexpected(first.error());
  const auto second = usable(map, second_id);
  if (!second) return tl::unexpected(second.error());
  const KnownTag& a = (*first)->tag;
  const KnownTag& b = (*second)->tag;
  const Eigen::Vector3d apart = b.X_WT.p - a.X_WT.p;
  TagDistance out{.distance_m = apart.norm()};
  Eigen::Matrix3d covariance =
      a.covariance.topLeftCorner<3, 3>() + b.covariance.topLeftCorner<3, 3>();
  const auto shared = map.known ? map.known->between(first_id, second_id) : std::nullopt;
  out.is_tied = shared.has_value();
  if (shared) {
    const Eigen::Matrix3d both = shared->topLeftCorner<3, 3>();
    covariance -= both + both.transpose();
  }
  const Eigen::Vector3d along = apart.normalized();
  out.sigma_m = std::sqrt(std::max(0.0, along.dot(covariance * along)));
  return out;
}

}  // namespace fiducap
