#include "mapping/map_edit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "base/text.hpp"

namespace fiducap {

namespace {

constexpr double kUnitQuaternion = 1e-3;
// Horizontal spread below which places do not determine a heading.
constexpr double kLeastSpread_m = 0.1;
// Distances that differ from the map's by more than this factor are in another unit.
constexpr double kOtherUnit = 5;

using Points = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;  // W, R

std::string the_tag(int tag_id) { return "tag " + std::to_string(tag_id); }

tl::unexpected<Error> invalid(std::string what) {
  return fail(ErrorCode::kInvalid, std::move(what));
}

Expected<const MapTag*> tag_in(const TagMap& map, int tag_id) {
  if (const MapTag* entry = map.find(tag_id)) return entry;
  return fail(ErrorCode::kNotFound, the_tag(tag_id) + " is not in version " +
                                        std::to_string(map.version) + " of the map");
}

Expected<const MapTag*> usable_tag_in(const TagMap& map, int tag_id) {
  auto entry = tag_in(map, tag_id);
  if (!entry) return entry;
  if ((*entry)->component != 0)
    return invalid(the_tag(tag_id) + " is not connected to the workspace by any sighting");
  if ((*entry)->state == TagState::kQuarantined)
    return invalid(the_tag(tag_id) + " is quarantined: its place is not known");
  return entry;
}

// --- edit ---

Expected<void> check_survey(const SurveyedTag& tag, const MapTag* known) {
  const std::string needs = "the survey of " + the_tag(tag.tag_id) + " needs ";
  if (!tag.p_WT.allFinite()) return invalid(needs + "finite numbers");
  if (!(tag.sigma_m > 0) || !std::isfinite(tag.sigma_m))
    return invalid(needs + "its sigma in metres, above 0");
  if (!tag.q_WT && known == nullptr)
    return invalid(needs + "the attitude, w x y z: the map does not have the tag");
  if (tag.q_WT && !(std::abs(tag.q_WT->norm() - 1) <= kUnitQuaternion))
    return invalid(needs + "a quaternion of length 1, w x y z");
  if (!(tag.edge_m > 0) && known == nullptr)
    return invalid(needs + "the tag's size: the map does not have the tag");
  return {};
}

Expected<void> survey(TagMap& map, const SurveyedTag& tag) {
  MapTag* entry = map.find(tag.tag_id);
  if (auto good = check_survey(tag, entry); !good) return good;
  if (entry == nullptr) {
    entry = &map.insert({.tag = {.tag_id = tag.tag_id, .X_WT = {}}});
  }
  if (tag.edge_m > 0) entry->tag.edge_m = tag.edge_m;
  entry->tag.X_WT.p = tag.p_WT;
  if (tag.q_WT) entry->tag.X_WT.q = tag.q_WT->normalized();
  const double sigma_rad = tag.sigma_m / (0.5 * entry->tag.edge_m);
  entry->tag.covariance = Matrix6d::Zero();
  entry->tag.covariance.diagonal().head<3>().setConstant(tag.sigma_m * tag.sigma_m);
  entry->tag.covariance.diagonal().tail<3>().setConstant(sigma_rad * sigma_rad);
  entry->state = TagState::kSurveyed;
  entry->component = 0;
  drop_correlations(map, tag.tag_id);
  return {};
}

// --- alignment ---

double worst_of(const Points& points, const Pose& X_RW) {
  double worst = 0;
  for (const auto& [p_W, p_R] : points) worst = std::max(worst, (p_R - X_RW * p_W).norm());
  return worst;
}

Points without(const Points& points, std::size_t i) {
  Points others = points;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
  return others;
}

/// Root mean square distance from the centroid. @param axes  2: seen from above
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
    const Points others = without(points, i);
    const double worst = worst_of(others, fit_yaw_and_shift(others));
    if (worst < least) {
      least = worst;
      found = i;
    }
  }
  return found;
}

/// The axis whose reversal makes the places fit; empty: none.
std::string mirrored_axis(const Points& points, double most_off_m) {
  for (int axis = 0; axis < 3; ++axis) {
    Points mirrored = points;
    for (auto& [p_W, p_R] : mirrored) p_R[axis] = -p_R[axis];
    if (worst_of(mirrored, fit_yaw_and_shift(mirrored)) > most_off_m) continue;
    return axis == 2 ? "z points down" : "x and y are left-handed";
  }
  return {};
}

Expected<Points> points_of(const TagMap& map, std::span<const MeasuredPlace> places) {
  Points points;
  std::set<int> ids;
  for (const MeasuredPlace& place : places) {
    const auto entry = usable_tag_in(map, place.tag_id);
    if (!entry) return tl::unexpected(entry.error());
    if (!ids.insert(place.tag_id).second) return invalid(the_tag(place.tag_id) + " is there twice");
    if (!place.p_RT.allFinite())
      return invalid("the place of " + the_tag(place.tag_id) + " must be finite");
    points.emplace_back((*entry)->tag.X_WT.p, place.p_RT);
  }
  if (points.size() < 3)
    return invalid("needs the measured places of three tags or more, has " +
                   std::to_string(points.size()));
  if (spread(points, false, 2) < kLeastSpread_m)
    return invalid("these tags are above each other: they do not determine the room's x");
  return points;
}

/// @pre the places do not fit
std::string misfit_text(std::span<const MeasuredPlace> places, const Points& points,
                        double most_off_m) {
  const double scale = spread(points, true) / spread(points, false);
  if (scale > kOtherUnit || scale < 1 / kOtherUnit)
    return "the measured places are " + fixed(scale, scale > 1 ? 0 : 4) +
           " times as far apart as the map has the tags: metres are expected";
  const std::size_t worst = most_contradicting(points);
  const std::string name = the_tag(places[worst].tag_id);
  if (const std::string axis = mirrored_axis(points, most_off_m); !axis.empty())
    return "the room is mirrored, " + axis + " (" + name +
           " shows it): axes must be right-handed, z up";
  const Pose X_RW = fit_yaw_and_shift(without(points, worst));
  const double off_m = (points[worst].second - X_RW * points[worst].first).norm();
  return "the place of " + name + " contradicts the others: it is " + fixed(1e3 * off_m, 0) +
         " mm from the place that they give it, more than " + fixed(1e3 * most_off_m, 0) + " mm";
}

}  // namespace

void drop_correlations(TagMap& map, int tag_id) {
  if (map.known == nullptr) return;
  map.known = std::make_shared<const KnownMap>(
      without_tags(*map.known, [&](int one) { return one == tag_id; }));
}

KnownMap without_tags(KnownMap known, const std::function<bool(int tag_id)>& is_out) {
  for (auto* const tags : {&known.tags, &known.uncorrelated})
    std::erase_if(*tags, [&](const KnownTag& tag) { return is_out(tag.tag_id); });
  std::erase_if(known.pairs, [&](const KnownPair& pair) {
    return is_out(pair.first_id) || is_out(pair.second_id);
  });
  return known;
}

Expected<TagMap> edited_map(TagMap map, const MapEdit& edit) {
  if (edit.forget.empty() && edit.quarantine.empty() && !edit.survey)
    return invalid("nothing to change: forget, quarantine or survey a tag");
  for (const int tag_id : edit.forget) {
    if (auto entry = tag_in(map, tag_id); !entry) return tl::unexpected(entry.error());
    if (map.reference_tag == tag_id)
      return invalid(the_tag(tag_id) + " is the reference tag: it defines the workspace");
    std::erase_if(map.tags, [&](const MapTag& tag) { return tag.tag.tag_id == tag_id; });
    drop_correlations(map, tag_id);
  }
  for (const int tag_id : edit.quarantine) {
    if (auto entry = tag_in(map, tag_id); !entry) return tl::unexpected(entry.error());
    map.find(tag_id)->state = TagState::kQuarantined;
    drop_correlations(map, tag_id);
  }
  if (edit.survey) {
    if (auto done = survey(map, *edit.survey); !done) return tl::unexpected(done.error());
  }
  return map;
}

std::string words_of(const MapEdit& edit) {
  std::string words;
  const auto add = [&](int tag_id, const char* what) {
    words += (words.empty() ? "" : ", ") + the_tag(tag_id) + what;
  };
  for (const int tag_id : edit.forget) add(tag_id, " forgotten");
  for (const int tag_id : edit.quarantine) add(tag_id, " quarantined");
  if (edit.survey) add(edit.survey->tag_id, " surveyed");
  return words;
}

Expected<MapAlignment> align(const TagMap& map, std::span<const MeasuredPlace> places,
                             double most_off_m) {
  const auto points = points_of(map, places);
  if (!points) return tl::unexpected(points.error());
  MapAlignment out{.X_RW = fit_yaw_and_shift(*points), .residuals = {}};
  if (worst_of(*points, out.X_RW) > most_off_m)
    return invalid(misfit_text(places, *points, most_off_m));
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto& [p_W, p_R] = (*points)[i];
    out.residuals.push_back({places[i].tag_id, p_R - out.X_RW * p_W});
  }
  return out;
}

Expected<TagDistance> distance_between(const TagMap& map, int first_id, int second_id) {
  if (first_id == second_id)
    return invalid("a distance needs two tags, " + the_tag(first_id) + " is there twice");
  const auto first = usable_tag_in(map, first_id);
  if (!first) return tl::unexpected(first.error());
  const auto second = usable_tag_in(map, second_id);
  if (!second) return tl::unexpected(second.error());
  const KnownTag& a = (*first)->tag;
  const KnownTag& b = (*second)->tag;
  const Eigen::Vector3d apart = b.X_WT.p - a.X_WT.p;
  TagDistance out{.distance_m = apart.norm()};
  Eigen::Matrix3d covariance =
      a.covariance.topLeftCorner<3, 3>() + b.covariance.topLeftCorner<3, 3>();
  const auto shared = map.known ? map.known->between(first_id, second_id) : std::nullopt;
  out.is_correlated = shared.has_value();
  if (shared) {
    const Eigen::Matrix3d both = shared->topLeftCorner<3, 3>();
    covariance -= both + both.transpose();
  }
  const Eigen::Vector3d along = apart.normalized();
  out.sigma_m = std::sqrt(std::max(0.0, along.dot(covariance * along)));
  return out;
}

}  // namespace fiducap
