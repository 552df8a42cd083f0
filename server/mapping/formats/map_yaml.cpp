#include "mapping/formats/map_yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <set>
#include <string_view>

#include "base/yaml_text.hpp"
#include "detection/tag_family_list.hpp"
#include "mapping/formats/imported_tags.hpp"
#include "mapping/formats/text_number.hpp"

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
  for (const double v : numbers) out += (out.size() > 1 ? ", " : "") + to_text(v);
  return out + "]";
}

std::string pose_lines(const Pose& pose, const std::string& indent) {
  const auto& [q, p] = pose;
  return indent + "position: " + list_of(std::array{p.x(), p.y(), p.z()}) + "\n" + indent +
         "quaternion_wxyz: " + list_of(std::array{q.w(), q.x(), q.y(), q.z()}) + "\n";
}

std::string tag_lines(const MapTag& entry) {
  std::string out = "  - id: " + std::to_string(entry.tag.tag_id) + "\n";
  out += "    edge_m: " + to_text(entry.tag.edge_m) + "\n";
  out += pose_lines(entry.tag.X_WT, "    ");
  out += "    state: " + std::string(name_of(entry.state)) + "\n";
  out += "    component: " + std::to_string(entry.component) + "\n";
  out += "    sightings: " + std::to_string(entry.sightings) + "\n";
  out += "    first_seen_utc_ns: " + std::to_string(entry.first_seen_utc_ns) + "\n";
  out += "    last_seen_utc_ns: " + std::to_string(entry.last_seen_utc_ns) + "\n";
  if (entry.tag.covariance.isZero(0)) return out;
  std::vector<double> upper;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) upper.push_back(entry.tag.covariance(row, column));
  }
  return out + "    covariance: " + list_of(upper) + "\n";
}

// --- reading ---

/// First fault of the text; thrown and caught inside this file only, so that the readers below stay
/// readable.
struct Fault {
  int line;  ///< From 1; 0: not known.
  std::string what;
};

int line_of(const YAML::Node& node) { return node.Mark().is_null() ? 0 : node.Mark().line + 1; }

/// One mapping of the text: every key known, none twice, each read by name.
class Section final {
 public:
  Section(YAML::Node node, std::string name, std::initializer_list<std::string_view> keys)
      : node_(std::move(node)), name_(std::move(name)) {
    if (!node_.IsMap()) throw Fault{line_of(node_), label() + "must be a mapping"};
    std::set<std::string> seen;
    for (const auto& item : node_) {
      const auto key = item.first.IsScalar() ? item.first.Scalar() : std::string("(not a name)");
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
        throw Fault{line_of(item.first), path(key) + ": unknown key"};
      }
      if (!seen.insert(key).second)
        throw Fault{line_of(item.first), path(key) + ": is there twice"};
    }
  }

  [[nodiscard]] bool has(const std::string& key) const { return node_[key].IsDefined(); }
  [[nodiscard]] std::string path(const std::string& key) const {
    return name_.empty() ? key : name_ + "." + key;
  }
  [[nodiscard]] int line() const { return line_of(node_); }

  [[nodiscard]] YAML::Node child(const std::string& key) const {
    const YAML::Node found = node_[key];
    if (!found.IsDefined()) throw Fault{line(), path(key) + ": is missing"};
    return found;
  }
  [[nodiscard]] std::string text(const std::string& key) const {
    const auto found = child(key);
    if (!found.IsScalar()) throw Fault{line_of(found), path(key) + ": must be a text"};
    return found.Scalar();
  }
  template <typename T>
  [[nodiscard]] T number(const std::string& key) const {
    return number_of<T>(child(key), path(key));
  }
  template <std::size_t N>
  [[nodiscard]] std::array<double, N> numbers(const std::string& key) const {
    const auto found = child(key);
    if (!found.IsSequence() || found.size() != N) {
      throw Fault{line_of(found),
                  path(key) + ": must be a list of " + std::to_string(N) + " numbers"};
    }
    std::array<double, N> values{};
    for (std::size_t i = 0; i < N; ++i) {
      values[i] = number_of<double>(found[i], path(key) + "[" + std::to_string(i) + "]");
    }
    return values;
  }
  [[nodiscard]] Pose pose() const {
    const auto p = numbers<3>("position");
    const auto q = numbers<4>("quaternion_wxyz");
    return {Eigen::Quaterniond(q[0], q[1], q[2], q[3]), {p[0], p[1], p[2]}};
  }

 private:
  [[nodiscard]] std::string label() const { return name_.empty() ? "" : name_ + ": "; }
  template <typename T>
  static T number_of(const YAML::Node& node, const std::string& path) {
    const auto value = node.IsScalar() ? number_from<T>(node.Scalar()) : std::nullopt;
    if (value) return *value;
    const std::string found = node.IsScalar() ? " = '" + node.Scalar() + "'" : "";
    throw Fault{line_of(node), path + found +
                                   (std::is_integral_v<T> ? ": must be a whole number"
                                                          : ": must be a finite number")};
  }

  YAML::Node node_;
  std::string name_;
};

MapTag tag_of(const Section& section) {
  MapTag entry;
  entry.tag.tag_id = section.number<int>("id");
  entry.tag.edge_m = section.number<double>("edge_m");
  entry.tag.X_WT = section.pose();
  const auto state = tag_state_from(section.text("state"));
  if (!state) {
    throw Fault{line_of(section.child("state")),
                section.path("state") + " = '" + section.text("state") +
                    "': must be local, calibrated, surveyed or quarantined"};
  }
  entry.state = *state;
  if (section.has("component")) entry.component = section.number<int>("component");
  if (section.has("sightings")) entry.sightings = section.number<int>("sightings");
  if (section.has("first_seen_utc_ns"))
    entry.first_seen_utc_ns = section.number<std::int64_t>("first_seen_utc_ns");
  if (section.has("last_seen_utc_ns"))
    entry.last_seen_utc_ns = section.number<std::int64_t>("last_seen_utc_ns");
  if (!section.has("covariance")) return entry;
  const auto upper = section.numbers<21>("covariance");
  std::size_t next = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      entry.tag.covariance(row, column) = entry.tag.covariance(column, row) = upper[next++];
    }
  }
  return entry;
}

void read_tags(const YAML::Node& tags, TagMap& map) {
  if (!tags.IsSequence()) throw Fault{line_of(tags), "tags: must be a list"};
  ImportedTags imported;
  std::size_t index = 0;
  for (const YAML::Node& node : tags) {
    const std::string name = "tags[" + std::to_string(index++) + "]";
    const Section section(node, name,
                          {"id", "edge_m", "position", "quaternion_wxyz", "state", "component",
                           "sightings", "first_seen_utc_ns", "last_seen_utc_ns", "covariance"});
    const std::string place = name + " in line " + std::to_string(section.line());
    if (auto added = imported.add(tag_of(section), place); !added) {
      throw Fault{section.line(), name + ": " + added.error().what};
    }
  }
  map.tags = imported.take();
}

TagMap read_map(const YAML::Node& root) {
  const Section top(root, "",
                    {"format", "format_version", "family", "reference_tag", "version", "parent",
                     "hash", "created_utc_ns", "comment", "room_from_workspace", "tags"});
  if (const auto format = top.text("format"); format != kFormat) {
    throw Fault{line_of(top.child("format")), "format = '" + format + "': must be " + kFormat};
  }
  if (const auto version = top.number<int>("format_version"); version != kFormatVersion) {
    throw Fault{line_of(top.child("format_version")),
                "format_version = " + std::to_string(version) + ": this Fiducap reads 1"};
  }
  TagMap map;
  map.family = listed_tag_family(top.text("family"));
  if (top.has("reference_tag")) map.reference_tag = top.number<int>("reference_tag");
  if (top.has("version")) map.version = top.number<std::int64_t>("version");
  if (top.has("parent")) map.parent = top.number<std::int64_t>("parent");
  if (top.has("created_utc_ns")) map.created_utc_ns = top.number<std::int64_t>("created_utc_ns");
  if (top.has("comment")) map.comment = top.text("comment");
  if (top.has("room_from_workspace")) {
    map.X_RW = Section(top.child("room_from_workspace"), "room_from_workspace",
                       {"position", "quaternion_wxyz"})
                   .pose();
  }
  read_tags(top.child("tags"), map);
  if (const auto fault = fault_in(map)) throw Fault{0, *fault};
  restore_unit(map.X_RW);
  // Somebody who edits the text by hand makes another map.
  if (top.has("hash") && top.text("hash") == content_hash(map)) map.hash = top.text("hash");
  return map;
}

tl::unexpected<Error> failure(int line, const std::string& what, const std::string& context) {
  return fail(ErrorCode::kInvalid, what, line > 0 ? context + ":" + std::to_string(line) : context);
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
  if (auto fits = check_length(text, context); !fits) return tl::unexpected<Error>(fits.error());
  const auto root = load_yaml(text);
  if (!root) return failure(root.error().line, root.error().text(), context);
  try {
    return read_map(*root);
  } catch (const Fault& fault) {
    return failure(fault.line, fault.what, context);
  } catch (const YAML::Exception& error) {
    return failure(error.mark.is_null() ? 0 : error.mark.line + 1, "is not YAML: " + error.msg,
                   context);
  }
}

}  // namespace fiducap
