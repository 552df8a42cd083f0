#include "mapping/map_edit.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

namespace fiducap {

namespace {

constexpr double kUnitQuaternion = 1e-3;

std::string the_tag(int tag_id) { return "tag " + std::to_string(tag_id); }

Expected<MapTag*> tag_in(TagMap& map, int tag_id) {
  MapTag* entry = map.find(tag_id);
  if (entry == nullptr)
    return fail(ErrorCode::kNotFound, the_tag(tag_id) + " is not in version " +
                                          std::to_string(map.version) + " of the map");
  return entry;
}

Expected<void> check_survey(const SurveyedTag& tag, const MapTag* known) {
  const std::string name = "the survey of " + the_tag(tag.tag_id);
  if (!tag.p_WT.allFinite()) return fail(ErrorCode::kInvalid, name + " needs finite numbers");
  if (!(tag.sigma_m > 0) || !std::isfinite(tag.sigma_m))
    return fail(ErrorCode::kInvalid, name + " needs its sigma in metres, above 0");
  if (!tag.q_WT && known == nullptr)
    return fail(ErrorCode::kInvalid,
                name + " needs the attitude, w x y z: the map does not have the tag");
  if (tag.q_WT && !(std::abs(tag.q_WT->norm() - 1) <= kUnitQuaternion))
    return fail(ErrorCode::kInvalid, name + " needs a quaternion of length 1, w x y z");
  if (!(tag.edge_m > 0) && known == nullptr)
    return fail(ErrorCode::kInvalid, name + " needs the tag's size: the map does not have the tag");
  return {};
}

Expected<void> survey(TagMap& map, const SurveyedTag& tag) {
  MapTag* entry = map.find(tag.tag_id);
  if (auto good = check_survey(tag, entry); !good) return good;
  if (entry == nullptr) {
    const auto place = std::find_if(map.tags.begin(), map.tags.end(), [&](const MapTag& other) {
      return other.tag.tag_id > tag.tag_id;
    });
    entry = &*map.tags.insert(place, MapTag{});
    entry->tag.tag_id = tag.tag_id;
  }
  if (tag.edge_m > 0) entry->tag.edge_m = tag.edge_m;
  entry->tag.X_WT.p = tag.p_WT;
  if (tag.q_WT) entry->tag.X_WT.q = tag.q_WT->normalized();
  const double turned_rad = tag.sigma_m / (0.5 * entry->tag.edge_m);
  entry->tag.covariance = Matrix6d::Zero();
  entry->tag.covariance.diagonal().head<3>().setConstant(tag.sigma_m * tag.sigma_m);
  entry->tag.covariance.diagonal().tail<3>().setConstant(turned_rad * turned_rad);
  entry->state = TagState::kSurveyed;
  entry->component = 0;
  drop_ties(map, tag.tag_id);
  return {};
}

}  // namespace

void drop_ties(TagMap& map, int tag_id) {
  if (map.known == nullptr) return;
  KnownMap known = *map.known;
  std::erase_if(known.tags, [&](const KnownTag& tag) { return tag.tag_id == tag_id; });
  std::erase_if(known.pairs, [&](const KnownPair& pair) {
    return pair.first_id == tag_id || pair.second_id == tag_id;
  });
  map.known = std::make_shared<const KnownMap>(std::move(known));
}

Expected<TagMap> edited_map(TagMap map, const MapEdit& edit) {
  if (edit.forget.empty() && edit.quarantine.empty() && !edit.survey)
    return fail(ErrorCode::kInvalid, "nothing to change: forget, quarantine or survey a tag");
  for (const int tag_id : edit.forget) {
    if (auto entry = tag_in(map, tag_id); !entry) return tl::unexpected(entry.error());
    if (map.reference_tag == tag_id)
      return fail(ErrorCode::kInvalid,
                  the_tag(tag_id) + " is the reference tag: the workspace hangs on it");
    std::erase_if(map.tags, [&](const MapTag& tag) { return tag.tag.tag_id == tag_id; });
    drop_ties(map, tag_id);
  }
  for (const int tag_id : edit.quarantine) {
    const auto entry = tag_in(map, tag_id);
    if (!entry) return tl::unexpected(entry.error());
    (*entry)->state = TagState::kQuarantined;
    drop_ties(map, tag_id);
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

}  // namespace fiducap
