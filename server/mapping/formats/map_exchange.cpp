#include "mapping/formats/map_exchange.hpp"

#include <algorithm>

#include "mapping/formats/map_doubts.hpp"
#include "mapping/formats/text_number.hpp"

namespace fiducap {

namespace {

bool is_identity(const Pose& pose) {
  return pose.p.isZero(0) && pose.q.coeffs() == Eigen::Quaterniond::Identity().coeffs();
}

std::string edges_text(const std::vector<const MapTag*>& tags) {
  const auto [least, most] = std::minmax_element(
      tags.begin(), tags.end(),
      [](const MapTag* a, const MapTag* b) { return a->tag.edge_m < b->tag.edge_m; });
  const std::string smallest = to_text((*least)->tag.edge_m);
  const std::string largest = to_text((*most)->tag.edge_m);
  if (smallest == largest)
    return "sizes are not part of this format: all tags are " + largest + " m";
  return "sizes are not part of this format, which knows one for all; these tags are " + smallest +
         " to " + largest + " m";
}

}  // namespace

Expected<void> settle_family(ImportedMap& imported, const MapImportOptions& options,
                             const std::string& context) {
  std::string& family = imported.map.family;
  if (!family.empty() && !options.family.empty() && family != options.family) {
    return fail(ErrorCode::kInvalid,
                "holds tags of the family " + family + ", not " + options.family, context);
  }
  if (!family.empty()) return {};
  family = options.family;
  if (!family.empty()) return {};
  family = TagMap{}.family;
  imported.remarks.push_back("the file does not name the family of its tags: " + family +
                             " is assumed");
  return {};
}

std::vector<const MapTag*> tags_to_export(const TagMap& map, Keeps keeps,
                                          std::vector<std::string>& remarks) {
  std::vector<const MapTag*> tags;
  std::vector<int> left_out;
  bool has_sigmas = false;
  for (const MapTag& entry : map.tags) {
    if (!is_trusted(entry)) {
      left_out.push_back(entry.tag.tag_id);
      continue;
    }
    tags.push_back(&entry);
    has_sigmas = has_sigmas || !entry.tag.covariance.isZero(0);
  }
  if (!left_out.empty()) {
    remarks.push_back(tags_text(left_out) +
                      " left out: quarantined, or not joined to the workspace");
  }
  if (!keeps.sizes && !tags.empty()) remarks.push_back(edges_text(tags));
  if (has_sigmas) {
    remarks.push_back(keeps.sigmas ? "of the covariances only the sigma along each axis is written"
                                   : "covariances are not part of this format");
  }
  if (!keeps.alignment && !is_identity(map.X_RW)) {
    remarks.push_back(
        "the alignment to the room is not part of this format: places are in workspace axes, while "
        "poses are streamed in the room's");
  }
  return tags;
}

}  // namespace fiducap
