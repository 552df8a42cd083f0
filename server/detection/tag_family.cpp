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
#include <cctype>

// OpenCV 4.7 moved the dictionaries into another module and returns them by value.
#if __has_include(<opencv2/objdetect/aruco_dictionary.hpp>)
#include <opencv2/objdetect/aruco_dictionary.hpp>
#else
#include <opencv2/aruco.hpp>
#endif

#include "base/text.hpp"
#include "detection/other_families.hpp"

namespace fiducap {
namespace {

constexpr int kLibrary = -1;

/// Libapriltag's, then ArUco's in the order of OpenCV's numbers. OpenCV's AprilTag dictionaries are
/// rotated by half a turn and therefore families of their own.
constexpr std::array kFamilies{
    TagFamilyFacts{"tag36h11", 8, 2, 0, false, kLibrary},
    TagFamilyFacts{"tag36h10", 8, 1, 0, false, kLibrary},
    TagFamilyFacts{"tag25h9", 7, 1, 0, false, kLibrary},
    TagFamilyFacts{"tag16h5", 6, 0, 30, true, kLibrary},
    TagFamilyFacts{"tagCircle21h7", 5, 0, 0, false, kLibrary},
    TagFamilyFacts{"tagCircle49h12", 5, 0, 0, false, kLibrary},
    TagFamilyFacts{"tagCustom48h12", 6, 0, 0, false, kLibrary},
    TagFamilyFacts{"tagStandard41h12", 5, 1, 0, false, kLibrary},
    TagFamilyFacts{"tagStandard52h13", 6, 0, 0, false, kLibrary},
    TagFamilyFacts{"DICT_4X4_50", 6, 0, 40, true, 0},
    TagFamilyFacts{"DICT_4X4_100", 6, 0, 40, true, 1},
    TagFamilyFacts{"DICT_4X4_250", 6, 0, 40, true, 2},
    TagFamilyFacts{"DICT_4X4_1000", 6, 0, 40, true, 3},
    TagFamilyFacts{"DICT_5X5_50", 7, 1, 0, false, 4},
    TagFamilyFacts{"DICT_5X5_100", 7, 1, 0, false, 5},
    TagFamilyFacts{"DICT_5X5_250", 7, 0, 0, false, 6},
    TagFamilyFacts{"DICT_5X5_1000", 7, 0, 0, false, 7},
    TagFamilyFacts{"DICT_6X6_50", 8, 2, 0, false, 8},
    TagFamilyFacts{"DICT_6X6_100", 8, 2, 0, false, 9},
    TagFamilyFacts{"DICT_6X6_250", 8, 2, 0, false, 10},
    TagFamilyFacts{"DICT_6X6_1000", 8, 2, 0, false, 11},
    TagFamilyFacts{"DICT_7X7_50", 9, 2, 0, false, 12},
    TagFamilyFacts{"DICT_7X7_100", 9, 2, 0, false, 13},
    TagFamilyFacts{"DICT_7X7_250", 9, 2, 0, false, 14},
    TagFamilyFacts{"DICT_7X7_1000", 9, 1, 0, false, 15},
    TagFamilyFacts{"DICT_ARUCO_ORIGINAL", 7, 0, 40, true, 16},
    TagFamilyFacts{"DICT_APRILTAG_16h5", 6, 0, 30, true, 17},
    TagFamilyFacts{"DICT_APRILTAG_25h9", 7, 1, 0, false, 18},
    TagFamilyFacts{"DICT_APRILTAG_36h10", 8, 1, 0, false, 19},
    TagFamilyFacts{"DICT_APRILTAG_36h11", 8, 2, 0, false, 20},
};

std::string folded(std::string_view name) {
  std::string out;
  for (const char c : name) {
    if (c != '-' && c != '_' && c != ' ')
      out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

/// What programs write before `36h11`: apriltag_detector, Kalibr, ROS, PhotonVision, WPILib,
/// Limelight.
constexpr std::array<std::string_view, 10> kBeforeCode{
    "", "t", "tf", "tag", "ktag", "apriltag", "apriltags", "kapriltag", "apriltag2", "apriltag3"};

/// @param written  folded
bool is_apriltag(const TagFamilyFacts& family, std::string_view written) {
  for (const std::string_view kind : {"classic", "standard", "custom", "circle"})
    if (written.ends_with(kind)) written.remove_suffix(kind.size());  // Limelight
  const std::string_view code = family.name.substr(family.name.find_first_of("0123456789"));
  if (!written.ends_with(code)) return false;
  written.remove_suffix(code.size());
  for (const std::string_view kind : {"standard", "custom", "circle"})
    if (written.ends_with(kind)) {
      written.remove_suffix(kind.size());
      break;
    }
  return std::ranges::find(kBeforeCode, written) != kBeforeCode.end();
}

/// OpenCV's turned AprilTags have only names with DICT or aruco: any other name is AprilTag's own.
/// @param written  folded; for `DICT_4X4_50` any of its names
bool is_named(const TagFamilyFacts& family, const std::string& written) {
  if (family.dictionary < 0) return is_apriltag(family, written);
  const std::string name = folded(family.name);
  const std::string bare = name.substr(std::string_view("dict").size());
  if (written == "aruco") return bare == "arucooriginal";  // ArUco's own name
  return written == name || written == "aruco" + bare || written == "dictaruco" + bare ||
         (written == bare && !bare.starts_with("apriltag"));
}

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

using OpenCvDictionary = cv::aruco::Dictionary;

[[maybe_unused]] const OpenCvDictionary& value_of(const OpenCvDictionary& dictionary) {
  return dictionary;
}
[[maybe_unused]] const OpenCvDictionary& value_of(const cv::Ptr<OpenCvDictionary>& dictionary) {
  return *dictionary;
}

// Beyond the bits of any family: no image decodes to it.
constexpr std::uint64_t kNeverRead = std::uint64_t{1} << 63;
constexpr int kBorder = 1;  // black cells around the bits of an ArUco tag
constexpr int kQuarters = 4;

struct Bit {
  int column, row;
};

/// Libapriltag's order of bits: one quarter of the code, then the same quarter after each rotation
/// by 90°, and the middle bit last. A rotation of the tag then shifts the code by quarters.
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

/// @param code  in that order
bool has_rotational_symmetry(std::uint64_t code, int side) {
  const int quarter = side * side / kQuarters;
  const std::uint64_t turning = code >> (side % 2);
  const std::uint64_t half = (std::uint64_t{1} << (2 * quarter)) - 1;
  return (turning >> (2 * quarter)) == (turning & half);
}

/// One of OpenCV's predefined ArUco dictionaries.
struct ArucoFamily : apriltag_family_t {
  ArucoFamily(std::string_view family, int number) : apriltag_family_t{}, name_(family) {
    const auto predefined = cv::aruco::getPredefinedDictionary(number);
    const OpenCvDictionary& dictionary = value_of(predefined);
    const int side = dictionary.markerSize;
    FIDUCAP_ASSERT(side * side < 64);
    const std::vector<Bit> order = reading_order(side);
    for (const Bit& bit : order) {
      columns_.push_back(static_cast<std::uint32_t>(bit.column + kBorder));
      rows_.push_back(static_cast<std::uint32_t>(bit.row + kBorder));
    }
    for (int id = 0; id < dictionary.bytesList.rows; ++id) {
      const cv::Mat bits =
          OpenCvDictionary::getBitsFromByteList(dictionary.bytesList.row(id), side);
      std::uint64_t code = 0;
      for (const Bit& bit : order)
        code = code << 1 | (bits.at<std::uint8_t>(bit.row, bit.column) != 0 ? 1 : 0);
      codes_.push_back(has_rotational_symmetry(code, side) ? kNeverRead : code);
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

constexpr TagFamilyFacts kAprilGrid{kAprilGridFamily, 10, 2, 0, false, kLibrary};

/// Tag36h11 with one more black cell around it. Its codes are those of the family it is made of.
struct AprilGridFamily : apriltag_family_t {
  AprilGridFamily() : apriltag_family_t{}, narrow_(tag36h11_create()) {
    static_cast<apriltag_family_t&>(*this) = *narrow_;
    for (std::uint32_t i = 0; i < nbits; ++i) {
      columns_.push_back(narrow_->bit_x[i] + 1);
      rows_.push_back(narrow_->bit_y[i] + 1);
    }
    bit_x = columns_.data();
    bit_y = rows_.data();
    width_at_border += 2;
    total_width += 2;
  }
  ~AprilGridFamily() { tag36h11_destroy(narrow_); }
  AprilGridFamily(const AprilGridFamily&) = delete;
  AprilGridFamily& operator=(const AprilGridFamily&) = delete;

 private:
  apriltag_family_t* narrow_;
  std::vector<std::uint32_t> columns_, rows_;
};

void destroy_april_grid(apriltag_family_t* family) { delete static_cast<AprilGridFamily*>(family); }

void destroy_aruco(apriltag_family_t* family) { delete static_cast<ArucoFamily*>(family); }

}  // namespace

std::span<const TagFamilyFacts> tag_families() { return kFamilies; }

const TagFamilyFacts* find_tag_family(std::string_view name) {
  const auto same = std::ranges::find(kFamilies, name, &TagFamilyFacts::name);
  if (same != kFamilies.end()) return &*same;
  const std::string written = folded(name);
  const auto meant = std::ranges::find_if(
      kFamilies, [&](const TagFamilyFacts& one) { return is_named(one, written); });
  return meant == kFamilies.end() ? nullptr : &*meant;
}

std::string listed_tag_family(std::string name) {
  const TagFamilyFacts* found = find_tag_family(name);
  return found != nullptr ? std::string(found->name) : name;
}

std::string tag_family_names() {
  return comma_list(kFamilies, [](const TagFamilyFacts& one) { return one.name; });
}

std::string tag_family_rule(std::string_view name) {
  std::vector<std::string> names;
  for (const TagFamilyFacts& one : kFamilies) names.emplace_back(one.name);
  return must_be_one_of(names, name);
}

std::string tag_family_warning(std::string_view name) {
  const TagFamilyFacts* found = find_tag_family(name);
  if (found == nullptr || !found->is_weak) return {};
  return std::string(found->name) +
         " has few bits and yields false detections: prefer tag36h11 or DICT_6X6_250, or list the "
         "ids that are not in use in tags.ignore";
}

std::string half_turned_family(const std::string& family) {
  constexpr std::string_view kOpenCv = "DICT_APRILTAG_";
  const std::string twin = family.starts_with(kOpenCv) ? "tag" + family.substr(kOpenCv.size())
                           : family.starts_with("tag") ? std::string(kOpenCv) + family.substr(3)
                                                       : "";
  return is_tag_family(twin) ? twin : "";
}

Expected<TagFamily> TagFamily::named(const std::string& name) {
  if (name == kAprilGridFamily)
    return TagFamily(kAprilGrid, {new AprilGridFamily, destroy_april_grid});
  const TagFamilyFacts* facts = find_tag_family(name);
  if (facts == nullptr)
    return fail(ErrorCode::kUnsupported,
                "unknown tag family '" + name + "': " + tag_family_rule(name));
  if (facts->dictionary >= 0)
    return TagFamily(*facts, {new ArucoFamily(facts->name, facts->dictionary), destroy_aruco});
  const auto maker = std::ranges::find(kMakers, facts->name, &Maker::name);
  FIDUCAP_ASSERT(maker != kMakers.end());
  return TagFamily(*facts, {maker->create(), maker->destroy});
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
         " looks the same when rotated and shows no pose: use another id";
}

std::vector<std::uint8_t> TagFamily::cells(int id) const {
  FIDUCAP_ASSERT(has_pose(id));
  const std::unique_ptr<image_u8_t, void (*)(image_u8_t*)> image(
      apriltag_to_image(handle_.get(), static_cast<std::uint32_t>(id)), image_u8_destroy);
  std::vector<std::uint8_t> cells;
  for (int row = 0; row < width(); ++row) {
    const std::uint8_t* first = image->buf + row * image->stride;
    cells.insert(cells.end(), first, first + width());
  }
  return cells;
}

}  // namespace fiducap
