#include "mapping/formats/map_exchange.hpp"

#include <algorithm>
#include <set>

#include "detection/tag_family.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {

namespace {

// The quaternions of our own writer stay bit for bit as they are.
constexpr double kUnitToRounding = 1e-14;

constexpr double kLargestEdge_m = 10;
constexpr double kSmallestEdge_m = 1e-3;
constexpr double kFarthest_m = 1e6;
constexpr double kFarFromOrigin_m = 1e3;  // more than a hall; metres or millimetres?
constexpr double kBelowFloor_m = -0.05;
constexpr double kNearFloor_m = 0.3;
constexpr double kClearly = 0.7;  // cosine of 45 degrees
// Of the smaller edge: squares in one plane that reach further into each other cover each other.
constexpr double kOverlap = 0.05;
constexpr double kOnePlane = 0.25;
// A tag in the middle of a larger one (tagCustom48h12 has room for it), in edges of that.
constexpr double kNested = 0.25;
constexpr double kMiddle = 0.1;
constexpr double kHalfDiagonal = 0.7072;  // in edges
constexpr std::size_t kMostNamed = 10;

/// Numbers of tags on walls and near the floor, and of those that are upside down.
struct Orientations {
  std::size_t on_walls{0};
  std::size_t on_head{0};
  std::size_t on_floor{0};
  std::size_t into_floor{0};
};

Orientations orientations_in(const TagMap& map) {
  Orientations out;
  for (const MapTag& entry : map.tags) {
    const Eigen::Matrix3d R_WT = entry.tag.X_WT.rotation();
    if (std::abs(R_WT(2, 2)) < 1 - kClearly) {
      ++out.on_walls;
      out.on_head += R_WT(2, 1) < -kClearly ? 1 : 0;
    } else if (std::abs(R_WT(2, 2)) > kClearly && entry.tag.X_WT.p.z() < kNearFloor_m) {
      ++out.on_floor;
      out.into_floor += R_WT(2, 2) < 0 ? 1 : 0;
    }
  }
  return out;
}

template <typename Measure>
const MapTag& most_of(const TagMap& map, Measure measure) {
  return *std::ranges::max_element(
      map.tags, [&](const MapTag& a, const MapTag& b) { return measure(a) < measure(b); });
}

/// Length by which b reaches into the square of a along the axes of a.
double overlap_m(const KnownTag& a, const KnownTag& b) {
  const Pose X_AW = a.X_WT.inverse();
  double least = a.edge_m;
  for (int axis = 0; axis < 2; ++axis) {
    double from = 0.5 * a.edge_m;
    double to = -from;
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector3d in_a = X_AW * (b.X_WT * tag_corner(corner, b.edge_m));
      from = std::min(from, in_a[axis]);
      to = std::max(to, in_a[axis]);
    }
    least = std::min(least, std::min(to, 0.5 * a.edge_m) - std::max(from, -0.5 * a.edge_m));
  }
  return least;
}

bool cover_each_other(const KnownTag& a, const KnownTag& b) {
  const auto [small_m, large_m] = std::minmax(a.edge_m, b.edge_m);
  const Eigen::Vector3d normal = a.X_WT.q * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d away = b.X_WT.p - a.X_WT.p;
  if (away.norm() > kHalfDiagonal * (small_m + large_m)) return false;
  if (normal.dot(b.X_WT.q * Eigen::Vector3d::UnitZ()) < kClearly) return false;
  if (std::abs(normal.dot(away)) > kOnePlane * small_m) return false;
  if (small_m <= kNested * large_m && away.norm() <= kMiddle * large_m) return false;
  return std::min(overlap_m(a, b), overlap_m(b, a)) > kOverlap * small_m;
}

/// Tags that cover others, ascending, at most one more than a message names.
std::vector<int> covered_tags(const TagMap& map) {
  std::vector<const KnownTag*> by_x;
  double largest_m = 0;
  for (const MapTag& entry : map.tags) {
    by_x.push_back(&entry.tag);
    largest_m = std::max(largest_m, entry.tag.edge_m);
  }
  std::ranges::sort(by_x, {}, [](const KnownTag* tag) { return tag->X_WT.p.x(); });
  std::set<int> covered;
  for (std::size_t i = 0; i < by_x.size(); ++i) {
    const double reach_m = kHalfDiagonal * (by_x[i]->edge_m + largest_m);
    const double last_m = by_x[i]->X_WT.p.x() + reach_m;
    for (std::size_t j = i + 1; j < by_x.size() && by_x[j]->X_WT.p.x() < last_m; ++j) {
      if (!cover_each_other(*by_x[i], *by_x[j])) continue;
      covered.insert({by_x[i]->tag_id, by_x[j]->tag_id});
      if (covered.size() > kMostNamed) return {covered.begin(), covered.end()};
    }
  }
  return {covered.begin(), covered.end()};
}

std::string all_of(std::size_t count) { return "all " + std::to_string(count) + " tags "; }

bool is_identity(const Pose& pose) {
  return pose.p.isZero(0) && pose.q.coeffs() == Eigen::Quaterniond::Identity().coeffs();
}

std::string edges_text(const std::vector<const MapTag*>& tags) {
  const auto [least, most] = std::minmax_element(
      tags.begin(), tags.end(),
      [](const MapTag* a, const MapTag* b) { return a->tag.edge_m < b->tag.edge_m; });
  const std::string smallest = shortest((*least)->tag.edge_m);
  const std::string largest = shortest((*most)->tag.edge_m);
  if (smallest == largest)
    return "sizes are not part of this format: all tags are " + largest + " m";
  return "sizes are not part of this format, which has one for all; these tags are " + smallest +
         " to " + largest + " m";
}

}  // namespace

std::string to_point_text(double value) {
  std::string text = shortest(value);
  if (text.find('.') != std::string::npos) return text;
  const auto exponent = text.find('e');
  return text.insert(exponent == std::string::npos ? text.size() : exponent, ".0");
}

std::string yaml_fields(std::initializer_list<const char*> names,
                        std::initializer_list<double> values, const std::string& between) {
  std::string text;
  const auto* name = names.begin();
  for (const double value : values)
    text += (text.empty() ? "" : between) + *name++ + ": " + to_point_text(value);
  return text;
}

Expected<void> check_length(const std::string& text, const std::string& context) {
  if (text.size() <= kLongestMapText) return {};
  return fail(ErrorCode::kInvalid,
              "has " + std::to_string(text.size()) + " bytes, a map has at most 64 MiB", context);
}

void restore_unit(Pose& pose) {
  if (std::abs(pose.q.norm() - 1.0) > kUnitToRounding) pose.q.normalize();
}

Expected<void> ImportedTags::add(MapTag entry, const std::string& context) {
  if (const auto fault = fault_in(entry)) return fail(ErrorCode::kInvalid, *fault, context);
  restore_unit(entry.tag.X_WT);
  const int id = entry.tag.tag_id;
  const auto [first, is_new] = tags_.try_emplace(id, Placed{std::move(entry), context});
  if (is_new) return {};
  const std::string& place = first->second.context;
  return fail(ErrorCode::kInvalid,
              "tag id " + std::to_string(id) + " is there twice" +
                  (place.empty() ? "" : ", first at " + place),
              context);
}

std::vector<MapTag> ImportedTags::take() {
  std::vector<MapTag> sorted;
  sorted.reserve(tags_.size());
  for (auto& [id, placed] : tags_) sorted.push_back(std::move(placed.entry));
  tags_.clear();
  return sorted;
}

Expected<ImportedMap> with_family(ImportedMap imported, const MapImportOptions& options,
                                  const std::string& context) {
  std::string& family = imported.map.family;
  const std::string given = listed_tag_family(options.family);
  if (!family.empty() && !is_tag_family(family)) {
    if (given.empty())
      return fail(ErrorCode::kUnsupported,
                  "holds tags of the family " + family + ", which is not supported: it " +
                      tag_family_rule(family) +
                      "; if the tags on the wall are of another one, add --family NAME",
                  context);
    imported.remarks.push_back("the file names the family " + family +
                               ", which is not supported: " + given + " is taken as given");
    family = given;
  }
  if (!family.empty() && !given.empty() && family != given)
    return fail(ErrorCode::kInvalid, "holds tags of the family " + family + ", not " + given,
                context);
  if (family.empty()) family = given;
  if (!family.empty()) return imported;
  family = TagMap{}.family;
  imported.remarks.push_back("the file does not name the family of its tags: " + family +
                             " is assumed");
  return imported;
}

Expected<ImportedMap> checked_import(ImportedMap imported, const MapImportOptions& options,
                                     const std::string& context) {
  auto checked = with_family(std::move(imported), options, context);
  if (!checked) return checked;
  for (const MapTag& entry : checked->map.tags) {
    auto fault = unit_fault_of_edge(entry.tag.edge_m);
    if (!fault) fault = unit_fault_of_place(entry.tag.X_WT.p);
    if (fault)
      return fail(ErrorCode::kInvalid, "tag " + std::to_string(entry.tag.tag_id) + ": " + *fault,
                  context);
  }
  if (const auto covered = covered_tags(checked->map); !covered.empty()) {
    const Eigen::Vector3d& p = checked->map.find(covered.front())->tag.X_WT.p;
    return fail(ErrorCode::kInvalid,
                tags_text(covered) + " cover each other, near " + shortest(p.x()) + ", " +
                    shortest(p.y()) + ", " + shortest(p.z()) +
                    " m: were their places never filled in, or copied?",
                context);
  }
  for (std::string& remark : plausibility_remarks(checked->map))
    checked->remarks.push_back(std::move(remark));
  return checked;
}

std::optional<std::string> unit_fault_of_edge(double edge_m) {
  const std::string is = "edge is " + shortest(edge_m) + " m: must be at ";
  if (edge_m > kLargestEdge_m) return is + "most 10; sizes are in metres, 160 mm is 0.16";
  if (edge_m > 0 && edge_m < kSmallestEdge_m) return is + "least 0.001; sizes are in metres";
  return std::nullopt;
}

std::optional<std::string> unit_fault_of_place(const Eigen::Vector3d& p_WT) {
  if (p_WT.lpNorm<Eigen::Infinity>() <= kFarthest_m) return std::nullopt;
  return "position must be finite and within 1000 km of the origin";
}

std::vector<std::string> plausibility_remarks(const TagMap& map) {
  std::vector<std::string> remarks;
  if (map.tags.empty()) return remarks;
  const auto height = [](const MapTag& entry) { return entry.tag.X_WT.p.z(); };
  const auto distance = [](const MapTag& entry) { return entry.tag.X_WT.p.norm(); };
  const MapTag& highest = most_of(map, height);
  if (map.tags.size() > 1 && height(highest) < kBelowFloor_m)
    remarks.push_back(all_of(map.tags.size()) + "are below z = 0, the highest at " +
                      fixed(height(highest), 2) + " m: is z up in this file?");
  const MapTag& farthest = most_of(map, distance);
  if (distance(farthest) > kFarFromOrigin_m)
    remarks.push_back("tag " + std::to_string(farthest.tag.tag_id) + " is " +
                      fixed(distance(farthest), 0) +
                      " m from the origin: are the positions in metres?");
  const Orientations tags = orientations_in(map);
  if (tags.on_walls > 1 && tags.on_head == tags.on_walls)
    remarks.push_back(all_of(tags.on_walls) +
                      "on walls are upside down: does this file count y down and z into the tag, "
                      "as libapriltag does?");
  if (tags.on_floor > 1 && tags.into_floor == tags.on_floor)
    remarks.push_back(
        all_of(tags.on_floor) +
        "that lie flat near z = 0 face down: does this file count z into the tag, or z down?");
  return remarks;
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

std::vector<const MapTag*> tags_to_export(const TagMap& map, Keeps keeps,
                                          std::vector<std::string>& remarks) {
  std::vector<const MapTag*> tags;
  std::vector<int> left_out;
  for (const MapTag& entry : map.tags) {
    if (entry.is_usable())
      tags.push_back(&entry);
    else
      left_out.push_back(entry.tag.tag_id);
  }
  if (!left_out.empty())
    remarks.push_back(tags_text(left_out) +
                      " left out: quarantined, or not connected to the workspace");
  if (!keeps.sizes && !tags.empty()) remarks.push_back(edges_text(tags));
  if (!std::ranges::all_of(tags, [](const MapTag* entry) { return entry->tag.is_exact(); }))
    remarks.push_back(keeps.sigmas ? "of the covariances only the sigma along each axis is written"
                                   : "covariances are not part of this format");
  if (!keeps.alignment && !is_identity(map.X_RW))
    remarks.push_back(
        "the alignment to the room is not part of this format: places are in workspace axes, while "
        "poses are streamed in the room's");
  return tags;
}

}  // namespace fiducap
