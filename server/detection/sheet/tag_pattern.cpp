#include "detection/sheet/tag_pattern.hpp"

#include "detection/tag_family.hpp"

namespace fiducap {

Expected<std::vector<TagPattern>> tag_patterns(const std::string& name,
                                               const std::vector<int>& ids) {
  const auto family = TagFamily::named(name);
  if (!family) return tl::unexpected(family.error());
  std::vector<TagPattern> patterns;
  for (const int id : ids) {
    if (const std::string fault = family->fault_of(id); !fault.empty())
      return fail(ErrorCode::kInvalid, "id " + std::to_string(id) + ": " + fault);
    TagPattern pattern{
        id, family->width(), family->edge_width(), family->has_reversed_border(), {}};
    for (const std::uint8_t module : family->modules(id)) pattern.black.push_back(module == 0);
    patterns.push_back(std::move(pattern));
  }
  return patterns;
}

}  // namespace fiducap
