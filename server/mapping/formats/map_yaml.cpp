// Our own map text.
#include <array>
#include <string_view>

#include "base/text.hpp"
#include "detection/tag_family.hpp"
#include "mapping/formats/map_format.hpp"
#include "mapping/formats/yaml_place.hpp"

namespace fiducap {

namespace {

constexpr const char* kFormat = "fiducap-map";
constexpr int kFormatVersion = 1;

// --- writing ---

constexpr const char* kConvention =
    "# Where the tags of a workspace are.\n"
    "# Workspace axes: z up. Tag axes: origin in the centre of the black square, x right, y up, z "
    "out of the printed face;\n"
    "# edge_m is the edge of the black square, so the bottom-left corner is (-edge/2, -edge/2, 0) "
    "in tag axes.\n"
    "# position and quaternion_wxyz turn tag axes into workspace axes (metres, Hamilton, w "
    "first).\n"
    "# covariance: upper triangle, row by row, of position (m, workspace axes) then attitude (rad, "
    "rotation vector in\n"
    "# workspace axes); without it the tag is exact. state: local, calibrated, surveyed or "
    "quarantined.\n";

/// Double-quoted, so that any text survives.
std::string in_quotes(std::string_view text) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (code < 0x20 || code == 0x7f) {
      out += "\\x";
      out += kDigits[code >> 4];
      out += kDigits[code & 15];
    } else {
      out += c;
    }
  }
  return out + '"';
}

template <typename Numbers>
std::string list_of(const Numbers& numbers) {
  std::string out = "[";
  for (const double v : numbers) out += (out.size() > 1 ? ", " : "") + shortest(v);
  return out + "]";
}

std::string pose_lines(const Pose& pose, const std::string& indent) {
  const auto& [q, p] = pose;
  return indent + "position: " + list_of(std::array{p.x(), p.y(), p.z()}) + "\n" + indent +
         "quaternion_wxyz: " + list_of(std::array{q.w(), q.x(), q.y(), q.z()}) + "\n";
}

std::string tag_lines(const MapTag& entry) {
  std::string out = "  - id: " + std::to_string(entry.tag.tag_id) + "\n";
  out += "    edge_m: " + shortest(entry.tag.edge_m) + "\n";
  out += pose_lines(entry.tag.X_WT, "    ");
  out += "    state: " + std::string(name_of(entry.state)) + "\n";
  out += "    component: " + std::to_string(entry.component) + "\n";
  out += "    sightings: " + std::to_string(entry.sightings) + "\n";
  out += "    first_seen_utc_ns: " + std::to_string(entry.first_seen_utc_ns) + "\n";
  out += "    last_seen_utc_ns: " + std::to_string(entry.last_seen_utc_ns) + "\n";
  if (entry.tag.covariance.isZero(0)) return out;
  std::vector<double> upper;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) upper.push_back(entry.tag.covariance(row, column));
  return out + "    covariance: " + list_of(upper) + "\n";
}

// --- reading ---

Pose pose_in(const YamlPlace& place) {
  std::array<double, 3> p{};
  std::array<double, 4> q{};
  place.at("position").numbers(p);
  place.at("quaternion_wxyz").numbers(q);
  return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), {p[0], p[1], p[2]}};
}

void read_covariance(const YamlPlace& place, Matrix6d& covariance) {
  std::array<double, 21> upper{};
  place.numbers(upper);
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column)
      covariance(row, column) = covariance(column, row) = upper[next++];
  }
}

MapTag tag_in(const YamlPlace& place) {
  place.only({"id", "edge_m", "position", "quaternion_wxyz", "state", "component", "sightings",
              "first_seen_utc_ns", "last_seen_utc_ns", "covariance"});
  MapTag entry;
  entry.tag.tag_id = place.at("id").integer();
  entry.tag.edge_m = place.at("edge_m").number();
  entry.tag.X_WT = pose_in(place);
  const YamlPlace state = place.at("state");
  if (const auto known = tag_state_from(state.text()))
    entry.state = *known;
  else
    state.refuse_value("must be local, calibrated, surveyed or quarantined");
  if (place.has("component")) entry.component = place.at("component").integer();
  if (place.has("sightings")) entry.sightings = place.at("sightings").integer();
  if (place.has("first_seen_utc_ns"))
    entry.first_seen_utc_ns = place.at("first_seen_utc_ns").integer64();
  if (place.has("last_seen_utc_ns"))
    entry.last_seen_utc_ns = place.at("last_seen_utc_ns").integer64();
  if (place.has("covariance")) read_covariance(place.at("covariance"), entry.tag.covariance);
  return entry;
}

std::vector<MapTag> read_tags(const YamlPlace& list) {
  ImportedTags imported;
  for (const YamlPlace& place : list.entries()) {
    if (auto added = imported.add(tag_in(place), place.named()); !added)
      place.refuse(added.error().what);
  }
  return imported.take();
}

TagMap read_own(const YamlPlace& top) {
  top.only({"format", "format_version", "family", "reference_tag", "version", "parent", "hash",
            "created_utc_ns", "comment", "room_from_workspace", "tags"});
  if (top.at("format").text() != kFormat)
    top.at("format").refuse_value(std::string("must be ") + kFormat);
  if (top.at("format_version").integer() != kFormatVersion)
    top.at("format_version").refuse_value("this Fiducap reads 1");
  TagMap map;
  map.family = listed_tag_family(top.at("family").text());
  if (top.has("reference_tag")) map.reference_tag = top.at("reference_tag").integer();
  if (top.has("version")) map.version = top.at("version").integer64();
  if (top.has("parent")) map.parent = top.at("parent").integer64();
  if (top.has("created_utc_ns")) map.created_utc_ns = top.at("created_utc_ns").integer64();
  if (top.has("comment")) map.comment = top.at("comment").text();
  if (top.has("room_from_workspace")) {
    const YamlPlace alignment = top.at("room_from_workspace");
    alignment.only({"position", "quaternion_wxyz"});
    map.X_RW = pose_in(alignment);
  }
  map.tags = read_tags(top.at("tags"));
  if (const auto fault = fault_in(map)) top.at("room_from_workspace").refuse(*fault);
  restore_unit(map.X_RW);
  // An edited text is another map.
  if (top.has("hash") && top.at("hash").text() == content_hash(map)) map.hash = content_hash(map);
  return map;
}

}  // namespace

std::string map_to_yaml(const TagMap& map) {
  std::string out = kConvention;
  out += std::string("format: ") + kFormat + "\nformat_version: " + std::to_string(kFormatVersion) +
         "\n";
  out += "family: " + in_quotes(map.family) + "\n";
  if (map.reference_tag) out += "reference_tag: " + std::to_string(*map.reference_tag) + "\n";
  out +=
      "version: " + std::to_string(map.version) + "\nparent: " + std::to_string(map.parent) + "\n";
  out += "hash: " + in_quotes(map.hash) + "\n";
  out += "created_utc_ns: " + std::to_string(map.created_utc_ns) + "\n";
  out += "comment: " + in_quotes(map.comment) + "\n";
  out += "room_from_workspace:\n" + pose_lines(map.X_RW, "  ");
  out += map.tags.empty() ? "tags: []\n" : "tags:\n";
  for (const MapTag& entry : map.tags) out += tag_lines(entry);
  return out;
}

Expected<TagMap> map_from_yaml(const std::string& text, const std::string& context) {
  TagMap map;
  return read_yaml(text, context, [&](const YamlPlace& top) { map = read_own(top); }).map([&] {
    return std::move(map);
  });
}

}  // namespace fiducap
