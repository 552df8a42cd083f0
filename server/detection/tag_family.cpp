#include "detection/tag_family.hpp"

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
}

#include <algorithm>
#include <array>

#include "base/assert.hpp"

namespace fiducap {

namespace {

struct Entry {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array kFamilies{
    Entry{"tag36h11", tag36h11_create, tag36h11_destroy},
    Entry{"tag36h10", tag36h10_create, tag36h10_destroy},
    Entry{"tag25h9", tag25h9_create, tag25h9_destroy},
    Entry{"tag16h5", tag16h5_create, tag16h5_destroy},
    Entry{"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    Entry{"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    Entry{"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

}  // namespace

bool is_tag_family(const std::string& name) {
  return std::any_of(kFamilies.begin(), kFamilies.end(),
                     [&](const Entry& entry) { return name == entry.name; });
}

std::string tag_family_names() {
  std::string names;
  for (const Entry& entry : kFamilies)
    names += (names.empty() ? "" : ", ") + std::string(entry.name);
  return names;
}

Expected<TagFamily> TagFamily::named(const std::string& name) {
  for (const Entry& entry : kFamilies) {
    if (name == entry.name) return TagFamily(Handle(entry.create(), entry.destroy));
  }
  return fail(ErrorCode::kUnsupported,
              "unknown tag family '" + name + "'; known are " + tag_family_names());
}

int TagFamily::ids() const { return static_cast<int>(handle_->ncodes); }
int TagFamily::width() const { return handle_->total_width; }
int TagFamily::edge_width() const { return handle_->width_at_border; }
bool TagFamily::has_reversed_border() const { return handle_->reversed_border; }

std::vector<std::uint8_t> TagFamily::modules(int id) const {
  FIDUCAP_ASSERT(id >= 0 && id < ids());
  const std::unique_ptr<image_u8_t, void (*)(image_u8_t*)> image(
      apriltag_to_image(handle_.get(), static_cast<std::uint32_t>(id)), image_u8_destroy);
  std::vector<std::uint8_t> modules;
  for (int row = 0; row < width(); ++row) {
    const std::uint8_t* first = image->buf + row * image->stride;
    modules.insert(modules.end(), first, first + width());
  }
  return modules;
}

}  // namespace fiducap
