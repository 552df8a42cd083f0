// RCARS workspaces. The estimator's qTI is passive (kindr): it takes inertial coordinates to the
// tag's, with the numbers of the Hamilton quaternion that turns tag axes into inertial ones. Tag
// axes x right, y up, z out.
#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "mapping/formats/map_exchange.hpp"
#include "mapping/formats/yaml_place.hpp"

namespace fiducap {

namespace {

constexpr int kHighestRcarsId = 255;  // its messages have one byte for an id
constexpr double kUnitLength_rcars = 1e-3;

Pose rcars_pose(const YamlPlace& place) {
  place.only({"position", "orientation"});
  const YamlPlace orientation = place.at("orientation");
  orientation.only({"w", "x", "y", "z"});
  return {Eigen::Quaterniond(orientation.at("w").number(), orientation.at("x").number(),
                             orientation.at("y").number(), orientation.at("z").number()),
          place.at("position").xyz()};
}

/// In the order of the list.
std::vector<std::pair<int, YamlPlace>> calibrated_ids(const YamlPlace& top) {
  std::vector<std::pair<int, YamlPlace>> ids;
  std::unordered_map<int, std::string> places;
  for (const YamlPlace& place : top.at("calibratedTags").entries()) {
    const int id = place.integer();
    if (const auto [first, is_new] = places.try_emplace(id, place.named()); !is_new)
      place.refuse("tag id " + std::to_string(id) + " is there twice, first at " + first->second);
    ids.emplace_back(id, place);
  }
  return ids;
}

/// The room of Fiducap is what RCARS calls workspace.
void align(const YamlPlace& top, ImportedMap& imported) {
  if (!top.has("referenceTagId")) {
    if (top.has("T_workspace_refTag"))
      top.at("T_workspace_refTag").refuse("needs referenceTagId, which is missing");
    return;
  }
  const YamlPlace reference = top.at("referenceTagId");
  const MapTag* tag = imported.map.find(reference.integer());
  if (tag == nullptr)
    reference.refuse("tag " + std::to_string(reference.integer()) + " is no calibrated tag");
  imported.map.reference_tag = tag->tag.tag_id;
  if (!top.has("T_workspace_refTag")) return;
  const YamlPlace place = top.at("T_workspace_refTag");
  Pose X_RT = rcars_pose(place);
  if (std::abs(X_RT.q.norm() - 1) > kUnitLength_rcars)
    place.refuse("quaternion has length " + shortest(X_RT.q.norm()) + ": must be 1");
  if (const auto fault = unit_fault_of_place(X_RT.p)) place.refuse(*fault);
  restore_unit(X_RT);
  imported.map.X_RW = X_RT * tag->tag.X_WT.inverse();
  imported.remarks.push_back(
      "T_workspace_refTag became the alignment of the map to the room; RCARS itself does not apply "
      "it");
}

ImportedMap read_rcars(const YamlPlace& top, double edge_m) {
  top.only({"calibratedTags", "referenceTagId", "T_workspace_refTag", "tags"});
  std::unordered_map<std::string, YamlPlace> by_name;
  for (auto& [name, place] : top.at("tags").members()) by_name.emplace(name, place);
  ForeignTags tags;
  for (const auto& [id, listed] : calibrated_ids(top)) {
    const std::string name = "tag" + std::to_string(id);
    const auto found = by_name.find(name);
    if (found == by_name.end()) listed.refuse("tags." + name + " is missing");
    const YamlPlace place = found->second;
    place.only({"type", "pose"});
    if (const std::string type = place.at("type").text(); type != "static")
      place.at("type").refuse("is '" + type + "': must be static");
    KnownTag tag;
    tag.tag_id = id;
    tag.edge_m = edge_m;
    tag.X_WT = rcars_pose(place.at("pose"));
    tags.add(tag, place);
    by_name.erase(found);
  }
  std::vector<std::string> remarks{"the file has no sizes: all tags are " + shortest(edge_m) +
                                   " m"};
  if (!by_name.empty()) {
    remarks.push_back(std::to_string(by_name.size()) +
                      " entries of tags left out that calibratedTags does not name, such as " +
                      std::ranges::min_element(by_name, [](const auto& a, const auto& b) {
                        return a.first < b.first;
                      })->first);
  }
  ImportedMap imported = tags.take({}, std::move(remarks));
  align(top, imported);
  return imported;
}

std::string rcars_lines(const Pose& pose, const std::string& indent) {
  const auto& [q, p] = pose;
  const std::string line = "\n" + indent + "  ";
  return indent + "position:" + line + yaml_fields({"x", "y", "z"}, {p.x(), p.y(), p.z()}, line) +
         "\n" + indent + "orientation:" + line +
         yaml_fields({"w", "x", "y", "z"}, {q.w(), q.x(), q.y(), q.z()}, line) + "\n";
}

}  // namespace

Expected<ImportedMap> map_from_rcars_yaml(const std::string& text, const MapImportOptions& options,
                                          const std::string& context) {
  if (!options.edge_m)
    return fail(ErrorCode::kInvalid,
                "RCARS workspaces do not contain the size of the tags; add --tag-size METRES",
                context);
  return read_foreign_yaml(text, options, context,
                           [&](const YamlPlace& top) { return read_rcars(top, *options.edge_m); });
}

ExportedMap map_to_rcars_yaml(const TagMap& map) {
  ExportedMap exported;
  std::string& text = exported.text;
  const MapTag* reference = map.reference_tag ? map.find(*map.reference_tag) : nullptr;
  if (reference != nullptr && !reference->is_usable()) reference = nullptr;
  const auto tags =
      tags_to_export(map, {.sizes = false, .alignment = reference != nullptr}, exported.remarks);
  text = "# Tags of the family " + map.family + ".\ncalibratedTags: [";
  std::vector<int> high;
  for (const MapTag* entry : tags) {
    text += (entry == tags.front() ? "" : ", ") + std::to_string(entry->tag.tag_id);
    if (entry->tag.tag_id > kHighestRcarsId) high.push_back(entry->tag.tag_id);
  }
  text += "]\n";
  if (reference != nullptr)
    text += "referenceTagId: " + std::to_string(reference->tag.tag_id) + "\nT_workspace_refTag:\n" +
            rcars_lines(map.X_RW * reference->tag.X_WT, "  ");
  text += tags.empty() ? "tags: {}\n" : "tags:\n";
  for (const MapTag* entry : tags)
    text += "  tag" + std::to_string(entry->tag.tag_id) + ":\n    type: static\n    pose:\n" +
            rcars_lines(entry->tag.X_WT, "      ");
  if (!high.empty())
    exported.remarks.push_back("RCARS cannot see " + tags_text(high) + ": ids end at 255");
  return exported;
}

}  // namespace fiducap
