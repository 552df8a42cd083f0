// Field layouts of WPILib and PhotonVision.

#include <nlohmann/json.hpp>

#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/map_format.hpp"

namespace fiducap {

namespace {

using nlohmann::json;

// No family has more; keeps larger numbers away from the cast.
constexpr double kHighestId = 1e6;

/// Tag axes of the field layout (x out of the face, y to the viewer's right, z up) from ours (x
/// right, y up, z out): our x is its y, our y its z, our z its x.
const Eigen::Quaterniond kq_FieldTag_Tag(0.5, 0.5, 0.5, 0.5);

/// A value of a layout and its path. Getters throw the first fault as an Error.
struct JsonPlace {
  const json& value;
  std::string path;

  [[noreturn]] void refuse(std::string what) const {
    throw Error{ErrorCode::kInvalid, std::move(what), path};
  }
  [[nodiscard]] JsonPlace at(const std::string& name) const {
    if (!value.is_object()) refuse("expected an object with '" + name + "'");
    const auto found = value.find(name);
    if (found == value.end()) refuse("'" + name + "' is missing");
    return {*found, path + "/" + name};
  }
  [[nodiscard]] double number(const std::string& name) const {
    const JsonPlace found = at(name);
    if (!found.value.is_number()) refuse("'" + name + "' must be a number");
    return found.value.get<double>();
  }
};

Pose field_pose(const JsonPlace& pose) {
  const JsonPlace p = pose.at("translation");
  const JsonPlace q = pose.at("rotation").at("quaternion");
  Pose X;
  X.p = {p.number("x"), p.number("y"), p.number("z")};
  X.q = {q.number("W"), q.number("X"), q.number("Y"), q.number("Z")};
  return X;
}

MapTag field_tag(const JsonPlace& tag, double edge_m) {
  const json& id = tag.at("ID").value;
  if (!id.is_number_integer() || id.get<double>() < 0 || id.get<double>() > kHighestId)
    tag.refuse("'ID' = " + id.dump() + ": must be a whole number from 0 to 1000000");
  const Pose X_WF = field_pose(tag.at("pose"));
  MapTag entry;
  entry.state = TagState::kSurveyed;
  entry.tag.tag_id = id.get<int>();
  entry.tag.edge_m = edge_m;
  // Not by the product of poses, which normalises: the check needs the file's quaternion.
  entry.tag.X_WT = {X_WF.q * kq_FieldTag_Tag, X_WF.p};
  return entry;
}

TagMap field_map(const json& layout, double edge_m, const std::string& context) {
  const JsonPlace top{layout, context};
  const json& tags = top.at("tags").value;
  if (!tags.is_array()) top.refuse("'tags' must be a list");
  ImportedTags imported;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const JsonPlace place{tags[i], context + " /tags/" + std::to_string(i)};
    if (auto added = imported.add(field_tag(place, edge_m), place.path); !added)
      throw Error(added.error());
  }
  TagMap map;
  map.tags = imported.take();
  return map;
}

/// How far the tags reach from the origin, with remarks.
FieldSize reach_of(const std::vector<const MapTag*>& tags, std::vector<std::string>& remarks) {
  Eigen::Vector2d most = Eigen::Vector2d::Zero();
  Eigen::Vector2d least = Eigen::Vector2d::Zero();
  for (const MapTag* entry : tags) {
    most = most.cwiseMax(entry->tag.X_WT.p.head<2>());
    least = least.cwiseMin(entry->tag.X_WT.p.head<2>());
  }
  remarks.push_back("length and width of the field are not part of a map: " + shortest(most.x()) +
                    " x " + shortest(most.y()) +
                    " m is how far the tags reach from the origin; add --field to set them");
  if (least.minCoeff() < 0)
    remarks.push_back("tags lie at negative x or y; WPILib's origin is a corner of the field");
  return {most.x(), most.y()};
}

}  // namespace

Expected<TagMap> map_from_wpilib_json(const std::string& text, double edge_m,
                                      const std::string& context) {
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  try {
    return field_map(json::parse(text), edge_m, context);
  } catch (const json::exception& error) {
    return fail(ErrorCode::kInvalid, std::string("is not JSON: ") + error.what(), context);
  } catch (const Error& error) {
    return tl::unexpected<Error>(error);
  }
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
