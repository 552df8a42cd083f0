#include "simulation/images/tag_family.hpp"

#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <array>

#include "base/assert.hpp"

namespace fiducap::simulation {

namespace {

struct Kind {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array<Kind, 5> kKinds{
    {{"tag36h11", tag36h11_create, tag36h11_destroy},
     {"tag25h9", tag25h9_create, tag25h9_destroy},
     {"tag16h5", tag16h5_create, tag16h5_destroy},
     {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
     {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy}}};

}  // namespace

const std::vector<std::string>& TagFamily::names() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> list;
    for (const Kind& kind : kKinds) list.emplace_back(kind.name);
    return list;
  }();
  return all;
}

Expected<TagFamily> TagFamily::named(const std::string& name) {
  for (const Kind& kind : kKinds) {
    if (name == kind.name) return TagFamily(Handle(kind.create(), kind.destroy));
  }
  return fail(ErrorCode::kUnsupported, "no such tag family: " + name);
}

int TagFamily::ids() const { return static_cast<int>(handle_->ncodes); }
int TagFamily::width() const { return handle_->total_width; }
int TagFamily::edge_width() const { return handle_->width_at_border; }

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

}  // namespace fiducap::simulation
