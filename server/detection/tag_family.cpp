#include "detection/tag_family.hpp"

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/common/image_u8.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
}

#include <algorithm>
#include <array>

#include "base/assert.hpp"
#include "detection/aruco_dictionary.hpp"

namespace fiducap {

namespace {

struct Maker {
  std::string_view name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr std::array kMakers{
    Maker{"tag36h11", tag36h11_create, tag36h11_destroy},
    Maker{"tag36h10", tag36h10_create, tag36h10_destroy},
    Maker{"tag25h9", tag25h9_create, tag25h9_destroy},
    Maker{"tag16h5", tag16h5_create, tag16h5_destroy},
    Maker{"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    Maker{"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    Maker{"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    Maker{"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    Maker{"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

// Beyond the bits of any family: no picture gives such a code.
constexpr std::uint64_t kNeverRead = std::uint64_t{1} << 63;
constexpr int kBorder = 1;  // black modules around the bits of an ArUco tag
constexpr int kQuarters = 4;

struct Bit {
  int column, row;
};

/// As libapriltag takes bits: one quarter of the code, then what becomes of it with each quarter of
/// a turn, and the middle one last. Codes then turn by moving quarters.
std::vector<Bit> reading_order(int side) {
  std::vector<Bit> quarter;
  for (int row = 0; row < side / 2; ++row)
    for (int column = 0; column < (side + 1) / 2; ++column) quarter.push_back({column, row});
  std::vector<Bit> order;
  for (int turn = 0; turn < kQuarters; ++turn) {
    order.insert(order.end(), quarter.begin(), quarter.end());
    for (Bit& bit : quarter) bit = {side - 1 - bit.row, bit.column};
  }
  if (side % 2 == 1) order.push_back({side / 2, side / 2});
  return order;
}

/// Of a code in that order.
bool looks_the_same_turned(std::uint64_t code, int side) {
  const int quarter = side * side / kQuarters;
  const std::uint64_t turning = code >> (side % 2);
  const std::uint64_t half = (std::uint64_t{1} << (2 * quarter)) - 1;
  return (turning >> (2 * quarter)) == (turning & half);
}

struct ArucoFamily : apriltag_family_t {
  ArucoFamily(std::string_view family, const ArucoDictionary& dictionary)
      : apriltag_family_t{}, name_(family) {
    const int side = dictionary.side;
    const std::vector<Bit> order = reading_order(side);
    for (const Bit& bit : order) {
      columns_.push_back(static_cast<std::uint32_t>(bit.column + kBorder));
      rows_.push_back(static_cast<std::uint32_t>(bit.row + kBorder));
    }
    for (const std::uint64_t printed : dictionary.codes) {
      std::uint64_t code = 0;
      for (const Bit& bit : order)
        code = code << 1 | (printed >> (side * side - 1 - bit.row * side - bit.column) & 1);
      codes_.push_back(looks_the_same_turned(code, side) ? kNeverRead : code);
    }
    ncodes = static_cast<std::uint32_t>(codes_.size());
    codes = codes_.data();
    nbits = static_cast<std::uint32_t>(order.size());
    bit_x = columns_.data();
    bit_y = rows_.data();
    width_at_border = side + 2 * kBorder;
    total_width = width_at_border + 2;
    name = name_.data();
  }

 private:
  std::string name_;
  std::vector<std::uint64_t> codes_;
  std::vector<std::uint32_t> columns_, rows_;
};

void destroy_aruco(apriltag_family_t* family) { delete static_cast<ArucoFamily*>(family); }

}  // namespace

TagFamily::Handle TagFamily::make(const TagFamilyFacts& facts) {
  if (facts.dictionary >= 0)
    return {new ArucoFamily(facts.name, aruco_dictionary(facts.dictionary)), destroy_aruco};
  const auto maker = std::find_if(kMakers.begin(), kMakers.end(),
                                  [&](const Maker& one) { return one.name == facts.name; });
  FIDUCAP_ASSERT(maker != kMakers.end());
  return {maker->create(), maker->destroy};
}

Expected<TagFamily> TagFamily::named(const std::string& name) {
  if (const TagFamilyFacts* facts = find_tag_family(name)) return TagFamily(*facts, make(*facts));
  return fail(ErrorCode::kUnsupported,
              "unknown tag family '" + name + "': " + tag_family_rule(name));
}

int TagFamily::ids() const { return static_cast<int>(handle_->ncodes); }
int TagFamily::width() const { return handle_->total_width; }
int TagFamily::edge_width() const { return handle_->width_at_border; }
bool TagFamily::has_reversed_border() const { return handle_->reversed_border; }

bool TagFamily::has_pose(int id) const {
  FIDUCAP_ASSERT(id >= 0 && id < ids());
  return handle_->codes[id] != kNeverRead;
}

std::string TagFamily::fault_of(int id) const {
  if (id < 0 || id >= ids())
    return std::string(facts_->name) + " has the ids 0 to " + std::to_string(ids() - 1);
  if (has_pose(id)) return {};
  return "this tag of " + std::string(facts_->name) +
         " looks the same when it is turned and shows no pose: take another id";
}

std::vector<std::uint8_t> TagFamily::modules(int id) const {
  FIDUCAP_ASSERT(has_pose(id));
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
