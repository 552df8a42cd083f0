// apriltag_ros bundles. Tag axes x right, y up, z out, the pose takes them into the bundle's axes;
// sizes are edges of the black square: so are ours. ROS asserts that a size is no whole number.
#include <algorithm>
#include <map>

#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/yaml_place.hpp"

namespace fiducap {

namespace {

KnownTag bundle_member(const YamlPlace& place) {
  place.only({"id", "size", "x", "y", "z", "qw", "qx", "qy", "qz"});
  KnownTag tag;
  tag.tag_id = place.at("id").integer();
  tag.edge_m = place.at("size").number();
  tag.X_WT.p = {place.number_or("x", 0), place.number_or("y", 0), place.number_or("z", 0)};
  tag.X_WT.q = {place.number_or("qw", 1), place.number_or("qx", 0), place.number_or("qy", 0),
                place.number_or("qz", 0)};
  return tag;
}

std::string name_of_bundle(const YamlPlace& bundle) {
  return bundle.has("name") ? "'" + bundle.at("name").text() + "'" : "without a name";
}

/// Sizes by id.
std::map<int, double> standalone_tags(const YamlPlace& top) {
  std::map<int, double> sizes;
  if (!top.has("standalone_tags") || top.at("standalone_tags").is_empty()) return sizes;
  for (const YamlPlace& place : top.at("standalone_tags").entries()) {
    place.only({"id", "size", "name"});
    const int id = place.at("id").integer();
    if (!sizes.emplace(id, place.at("size").number()).second)
      place.refuse("tag id " + std::to_string(id) + " is there twice among the standalone tags");
  }
  return sizes;
}

void add_bundle(const YamlPlace& bundle, std::map<int, double>& standalone, ForeignTags& tags) {
  bundle.only({"name", "layout"});
  for (const YamlPlace& place : bundle.at("layout").entries()) {
    const KnownTag tag = bundle_member(place);
    tags.add(tag, place);
    const auto alone = standalone.find(tag.tag_id);
    if (alone == standalone.end()) continue;
    if (alone->second != tag.edge_m)
      place.at("size").refuse("is " + shortest(tag.edge_m) +
                              ", but the standalone tag of this id has " + shortest(alone->second));
    standalone.erase(alone);
  }
}

/// At the top, or below the name of a node and `ros__parameters`, as launch files load it.
bool has_bundles(const YamlPlace& place) {
  return place.has("tag_bundles") || place.has("standalone_tags") ||
         std::ranges::any_of(place.members(), [](const auto& member) {
           return member.second.is_map() && has_bundles(member.second);
         });
}

ImportedMap read_bundles(const YamlPlace& top) {
  if (!top.has("tag_bundles") && !top.has("standalone_tags"))
    for (const auto& [name, inner] : top.members())
      if (inner.is_map() && has_bundles(inner)) return read_bundles(inner);
  std::vector<std::string> remarks;
  const std::string family = top.has("tag_family") ? top.at("tag_family").text() : std::string();
  top.remark_others({"tag_family", "tag_bundles", "standalone_tags"}, remarks);
  auto standalone = standalone_tags(top);
  ForeignTags tags;
  if (top.has("tag_bundles") && !top.at("tag_bundles").is_empty()) {
    const auto bundles = top.at("tag_bundles").entries();
    if (bundles.size() > 1)
      bundles[1].refuse("bundle " + name_of_bundle(bundles[1]) +
                        " has an origin of its own, whose place in bundle " +
                        name_of_bundle(bundles[0]) +
                        " is not in the file; keep one bundle in the file");
    for (const YamlPlace& bundle : bundles) add_bundle(bundle, standalone, tags);
  }
  if (!standalone.empty()) {
    std::vector<int> ids;
    for (const auto& one : standalone) ids.push_back(one.first);
    remarks.push_back("standalone " + tags_text(ids) + " left out: no place is given");
  }
  return tags.take(family, std::move(remarks));
}

}  // namespace

Expected<ImportedMap> map_from_bundle_yaml(const std::string& text, const MapImportOptions& options,
                                           const std::string& context) {
  return read_foreign_yaml(text, options, context, read_bundles);
}

ExportedMap map_to_bundle_yaml(const TagMap& map) {
  ExportedMap exported;
  std::string& text = exported.text;
  text =
      "# Tags of the family " + map.family +
      ". Metres; tag axes x right, y up, z out of the face; size is the edge of the black square.\n"
      "standalone_tags: []\n"
      "tag_bundles:\n"
      "  - name: fiducap_workspace\n";
  const auto tags = tags_to_export(map, {}, exported.remarks);
  text += tags.empty() ? "    layout: []\n" : "    layout:\n";
  for (const MapTag* entry : tags) {
    const auto& [q, p] = entry->tag.X_WT;
    text += "      - {id: " + std::to_string(entry->tag.tag_id) + ", " +
            yaml_fields({"size", "x", "y", "z", "qw", "qx", "qy", "qz"},
                        {entry->tag.edge_m, p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()}) +
            "}\n";
  }
  return exported;
}

}  // namespace fiducap
