#include <algorithm>
#include <array>

#include <nlohmann/json.hpp>

#include "mapping/formats/foreign_map.hpp"
#include "mapping/formats/imported_tags.hpp"
#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/map_yaml.hpp"
#include "mapping/formats/text_number.hpp"

namespace fiducap {

namespace {

using nlohmann::json;

// No family has more; keeps larger numbers away from the cast.
constexpr double kHighestId = 1e6;

/// Tag axes of the field layout (x out of the face, y to the viewer's right, z up) from ours (x
/// right, y up, z out): our x is its y, our y its z, our z its x.
const Eigen::Quaterniond kq_FieldTag_Tag(0.5, 0.5, 0.5, 0.5);

Expected<const json*> member(const json& parent, const char* name, const std::string& context) {
  if (!parent.is_object())
    return fail(ErrorCode::kInvalid, "expected an object with '" + std::string(name) + "'",
                context);
  const auto found = parent.find(name);
  if (found == parent.end())
    return fail(ErrorCode::kInvalid, "'" + std::string(name) + "' is missing", context);
  return &*found;
}

Expected<double> number(const json& parent, const char* name, const std::string& context) {
  const auto value = member(parent, name, context);
  if (!value) return tl::unexpected<Error>(value.error());
  if (!(*value)->is_number())
    return fail(ErrorCode::kInvalid, "'" + std::string(name) + "' must be a number", context);
  return (*value)->get<double>();
}

template <std::size_t N>
Expected<std::array<double, N>> numbers(const json& parent, const std::array<const char*, N>& names,
                                        const std::string& context) {
  std::array<double, N> values{};
  for (std::size_t i = 0; i < N; ++i) {
    const auto value = number(parent, names[i], context);
    if (!value) return tl::unexpected<Error>(value.error());
    values[i] = *value;
  }
  return values;
}

Expected<Pose> pose_from(const json& tag, const std::string& context) {
  const auto pose = member(tag, "pose", context);
  if (!pose) return tl::unexpected<Error>(pose.error());
  const auto translation = member(**pose, "translation", context + "/pose");
  if (!translation) return tl::unexpected<Error>(translation.error());
  const auto rotation = member(**pose, "rotation", context + "/pose");
  if (!rotation) return tl::unexpected<Error>(rotation.error());
  const auto quaternion = member(**rotation, "quaternion", context + "/pose/rotation");
  if (!quaternion) return tl::unexpected<Error>(quaternion.error());
  const auto p = numbers<3>(**translation, {"x", "y", "z"}, context + "/pose/translation");
  if (!p) return tl::unexpected<Error>(p.error());
  const auto q =
      numbers<4>(**quaternion, {"W", "X", "Y", "Z"}, context + "/pose/rotation/quaternion");
  if (!q) return tl::unexpected<Error>(q.error());
  const auto& [w, x, y, z] = *q;
  return Pose{Eigen::Quaterniond(w, x, y, z), {(*p)[0], (*p)[1], (*p)[2]}};
}

Expected<MapTag> tag_from(const json& tag, double edge_m, const std::string& context) {
  const auto id = member(tag, "ID", context);
  if (!id) return tl::unexpected<Error>(id.error());
  if (!(*id)->is_number_integer() || (*id)->get<double>() < 0 ||
      (*id)->get<double>() > kHighestId) {
    return fail(ErrorCode::kInvalid,
                "'ID' = " + (*id)->dump() + ": must be a whole number from 0 to 1000000", context);
  }
  const auto X_WF = pose_from(tag, context);
  if (!X_WF) return tl::unexpected<Error>(X_WF.error());
  MapTag entry;
  entry.state = TagState::kSurveyed;
  entry.tag.tag_id = (*id)->get<int>();
  entry.tag.edge_m = edge_m;
  // Not through Pose's product: a quaternion that is none must stay one for the check.
  entry.tag.X_WT = {X_WF->q * kq_FieldTag_Tag, X_WF->p};
  return entry;
}

/// How far the tags reach from the origin; remarks what makes that no playing field.
FieldSize reach_of(const std::vector<const MapTag*>& tags, std::vector<std::string>& remarks) {
  Eigen::Vector2d most = Eigen::Vector2d::Zero();
  Eigen::Vector2d least = Eigen::Vector2d::Zero();
  for (const MapTag* entry : tags) {
    most = most.cwiseMax(entry->tag.X_WT.p.head<2>());
    least = least.cwiseMin(entry->tag.X_WT.p.head<2>());
  }
  remarks.push_back("length and width of the field are not part of a map: " + to_text(most.x()) +
                    " x " + to_text(most.y()) +
                    " m is how far the tags reach from the origin; --field says better");
  if (least.minCoeff() < 0)
    remarks.push_back("tags lie at negative x or y; WPILib's origin is a corner of the field");
  return {most.x(), most.y()};
}

}  // namespace

Expected<TagMap> map_from_wpilib_json(const std::string& text, double edge_m,
                                      const std::string& context) {
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  json layout;
  try {
    layout = json::parse(text);
  } catch (const json::exception& error) {
    return fail(ErrorCode::kInvalid, std::string("is not JSON: ") + error.what(), context);
  }
  const auto tags = member(layout, "tags", context);
  if (!tags) return tl::unexpected<Error>(tags.error());
  if (!(*tags)->is_array()) return fail(ErrorCode::kInvalid, "'tags' must be a list", context);
  ImportedTags imported;
  for (std::size_t i = 0; i < (*tags)->size(); ++i) {
    const std::string place = context + " /tags/" + std::to_string(i);
    auto entry = tag_from((**tags)[i], edge_m, place);
    if (!entry) return tl::unexpected<Error>(entry.error());
    if (auto added = imported.add(std::move(*entry), place); !added)
      return tl::unexpected<Error>(added.error());
  }
  TagMap map;
  map.tags = imported.take();
  return map;
}

ExportedMap map_to_wpilib_json(const TagMap& map, std::optional<FieldSize> field) {
  ExportedMap exported;
  const auto tags = tags_to_export(map, {.sizes = false}, exported.remarks);
  if (!field) field = reach_of(tags, exported.remarks);
  nlohmann::ordered_json layout{
      {"tags", nlohmann::ordered_json::array()},
      {"field", {{"length", field->length_m}, {"width", field->width_m}}}};
  for (const MapTag* entry : tags) {
    const Eigen::Vector3d& p = entry->tag.X_WT.p;
    const Eigen::Quaterniond q = entry->tag.X_WT.q * kq_FieldTag_Tag.conjugate();
    layout["tags"].push_back(
        {{"ID", entry->tag.tag_id},
         {"pose",
          {{"translation", {{"x", p.x()}, {"y", p.y()}, {"z", p.z()}}},
           {"rotation",
            {{"quaternion", {{"W", q.w()}, {"X", q.x()}, {"Y", q.y()}, {"Z", q.z()}}}}}}}});
  }
  exported.text = layout.dump(2) + "\n";
  return exported;
}

}  // namespace fiducap
