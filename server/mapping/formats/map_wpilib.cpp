// Field layouts of WPILib and PhotonVision, and of Limelight.

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include <nlohmann/json.hpp>

#include "detection/tag_family.hpp"
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

/// A 4 x 4 matrix, row by row.
Pose matrix_pose(const JsonPlace& matrix) {
  constexpr double kRounded = 1e-3;
  if (!matrix.value.is_array() || matrix.value.size() != 16 ||
      !std::ranges::all_of(matrix.value, [](const json& one) { return one.is_number(); }))
    matrix.refuse("must be 16 numbers, a 4 x 4 matrix row by row");
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> X;
  for (int i = 0; i < 16; ++i)
    X.data()[i] = matrix.value[static_cast<std::size_t>(i)].get<double>();
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).norm() < kRounded) ||
      R.determinant() < 0 || !(X.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).isZero(kRounded))
    matrix.refuse("is no rigid transform: 4 x 4, row by row, 0 0 0 1 in the last row");
  return {Eigen::Quaterniond(R).normalized(), X.topRightCorner<3, 1>()};
}

/// @param id_key  ID of WPILib, id of Limelight
MapTag field_tag(const JsonPlace& tag, const char* id_key, const Pose& X_WF, double edge_m) {
  const json& id = tag.at(id_key).value;
  if (!id.is_number_integer() || id.get<double>() < 0 || id.get<double>() > kHighestId)
    tag.refuse("'" + std::string(id_key) + "' = " + id.dump() +
               ": must be a whole number from 0 to 1000000");
  MapTag entry;
  entry.state = TagState::kSurveyed;
  entry.tag.tag_id = id.get<int>();
  entry.tag.edge_m = edge_m;
  // Not by the product of poses, which normalises: the check needs the file's quaternion.
  entry.tag.X_WT = {X_WF.q * kq_FieldTag_Tag, X_WF.p};
  return entry;
}

/// @param read  one tag; nullopt: it is left out
template <typename Read>
TagMap field_map(const json& layout, const std::string& key, const std::string& context,
                 const Read& read) {
  const JsonPlace top{layout, context};
  const json& tags = top.at(key).value;
  if (!tags.is_array()) top.refuse("'" + key + "' must be a list");
  ImportedTags imported;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    const JsonPlace place{tags[i], context + " /" + key + "/" + std::to_string(i)};
    std::optional<MapTag> entry = read(place);
    if (!entry) continue;
    if (auto added = imported.add(*std::move(entry), place.path); !added)
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

template <typename Read>
Expected<TagMap> map_from_json(const std::string& text, const std::string& key,
                               const std::string& context, const Read& read) {
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  try {
    return field_map(json::parse(text), key, context, read);
  } catch (const json::exception& error) {
    return fail(ErrorCode::kInvalid, std::string("is not JSON: ") + error.what(), context);
  } catch (const Error& error) {
    return tl::unexpected<Error>(error);
  }
}

}  // namespace

std::vector<std::string> field_remarks(const TagMap& map) {
  constexpr double kFlat = 0.9;     // of the face's normal along z
  constexpr double kUpright = 0.7;  // cosine of 45°; FRC's fields have tags that lean by 30°
  std::vector<int> leaning;
  for (const MapTag& entry : map.tags) {
    const Eigen::Matrix3d R_WT = entry.tag.X_WT.rotation();
    if (std::abs(R_WT(2, 2)) < kFlat && R_WT(2, 1) < kUpright) leaning.push_back(entry.tag.tag_id);
  }
  if (leaning.empty()) return {};
  return {tags_text(leaning) + (leaning.size() == 1 ? " is" : " are") +
          " neither upright nor flat. In this format a tag's x points out of its face and its z "
          "up; in other programs the axes of a tag differ"};
}

Expected<TagMap> map_from_wpilib_json(const std::string& text, double edge_m,
                                      const std::string& context) {
  return map_from_json(text, "tags", context, [&](const JsonPlace& tag) {
    return field_tag(tag, "ID", field_pose(tag.at("pose")), edge_m);
  });
}

Expected<ImportedMap> map_from_limelight_json(const std::string& text, const std::string& context) {
  std::string family;
  std::string left_out;
  auto map = map_from_json(text, "fiducials", context, [&](const JsonPlace& tag) {
    const json& named = tag.at("family").value;
    const std::string its = named.is_string() ? listed_tag_family(named.get<std::string>()) : "";
    if (its.empty()) tag.refuse("'family' must be a text");
    if (family.empty()) family = its;
    if (its != family) tag.refuse("family " + its + ": the tags before are " + family);
    constexpr double kMillimetre = 1e-3;
    const MapTag entry =
        field_tag(tag, "id", matrix_pose(tag.at("transform")), kMillimetre * tag.number("size"));
    const auto unique = tag.value.find("unique");
    if (unique == tag.value.end() || (*unique != 0 && *unique != false))
      return std::optional<MapTag>(entry);
    left_out += " " + std::to_string(entry.tag.tag_id);
    return std::optional<MapTag>();
  });
  if (!map) return tl::unexpected<Error>(map.error());
  map->family = family;
  ImportedMap imported{std::move(*map),
                       {"the origin is the middle of the field, that of WPILib's files a corner"}};
  if (!left_out.empty())
    imported.remarks.push_back("tags that are not unique have no place and are left out:" +
                               left_out);
  std::ranges::move(field_remarks(imported.map), std::back_inserter(imported.remarks));
  return imported;
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

ExportedMap map_to_limelight_json(const TagMap& map, std::optional<FieldSize> field) {
  ExportedMap exported;
  const auto tags = tags_to_export(map, {}, exported.remarks);
  if (!field) field = reach_of(tags, exported.remarks);
  nlohmann::ordered_json layout{{"fiducials", nlohmann::ordered_json::array()},
                                {"fieldlength", field->length_m},
                                {"fieldwidth", field->width_m},
                                {"type", "frc"}};
  const std::string code = map.family.starts_with("tag") ? map.family.substr(3) : map.family;
  for (const MapTag* entry : tags) {
    const Eigen::Matrix3d R = (entry->tag.X_WT.q * kq_FieldTag_Tag.conjugate()).toRotationMatrix();
    const Eigen::Vector3d& p = entry->tag.X_WT.p;
    layout["fiducials"].push_back({{"family", "apriltag3_" + code + "_classic"},
                                   {"id", entry->tag.tag_id},
                                   {"size", 1e3 * entry->tag.edge_m},
                                   {"transform",
                                    {R(0, 0), R(0, 1), R(0, 2), p.x(), R(1, 0), R(1, 1), R(1, 2),
                                     p.y(), R(2, 0), R(2, 1), R(2, 2), p.z(), 0.0, 0.0, 0.0, 1.0}},
                                   {"unique", true}});
  }
  exported.text = layout.dump(2) + "\n";
  return exported;
}

}  // namespace fiducap
