#include "tools/tags/tag_pattern.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <array>
#include <memory>

namespace fiducap {
namespace {

struct Family {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array<Family, 6> kFamilies{{
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
}};

std::string family_names() {
  std::string names;
  for (const Family& family : kFamilies)
    names += (names.empty() ? "" : ", ") + std::string(family.name);
  return names;
}

TagPattern pattern_of(apriltag_family_t* family, int id) {
  const std::unique_ptr<image_u8_t, void (*)(image_u8_t*)> image(apriltag_to_image(family, id),
                                                                 image_u8_destroy);
  TagPattern pattern{id, family->total_width, family->width_at_border, family->reversed_border, {}};
  for (int row = 0; row < pattern.modules; ++row)
    for (int column = 0; column < pattern.modules; ++column)
      pattern.black.push_back(image->buf[row * image->stride + column] == 0);
  return pattern;
}

}  // namespace

Expected<std::vector<TagPattern>> tag_patterns(const std::string& name,
                                               const std::vector<int>& ids) {
  for (const Family& family : kFamilies) {
    if (name != family.name) continue;
    const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)> made(family.create(),
                                                                                family.destroy);
    std::vector<TagPattern> patterns;
    for (const int id : ids) {
      if (id < 0 || id >= static_cast<int>(made->ncodes))
        return fail(ErrorCode::kInvalid, name + " has the ids 0 to " +
                                             std::to_string(made->ncodes - 1) + ", not " +
                                             std::to_string(id));
      patterns.push_back(pattern_of(made.get(), id));
    }
    return patterns;
  }
  return fail(ErrorCode::kUnsupported,
              "unknown tag family '" + name + "'; known are " + family_names());
}

}  // namespace fiducap
