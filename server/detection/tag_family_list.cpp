#include "detection/tag_family_list.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <vector>

#include "base/closest_word.hpp"

namespace fiducap {

namespace {

constexpr int kLibrary = -1;

/// Libapriltag's, then ArUco's in the order of OpenCV's numbers. OpenCV turns AprilTags by half a
/// turn: its dictionaries of them are families of their own.
constexpr std::array kListed{
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

/// `DICT_4X4_50` by any of its names, all folded.
bool is_named(const TagFamilyFacts& family, const std::string& written) {
  const std::string name = folded(family.name);
  if (written == name) return true;
  if (family.dictionary < 0) return false;
  const std::string bare = name.substr(std::string_view("dict").size());
  return written == bare || written == "aruco" + bare || written == "dictaruco" + bare;
}

}  // namespace

std::span<const TagFamilyFacts> tag_families() { return kListed; }

const TagFamilyFacts* find_tag_family(std::string_view name) {
  const auto same = std::find_if(kListed.begin(), kListed.end(),
                                 [&](const TagFamilyFacts& one) { return one.name == name; });
  if (same != kListed.end()) return &*same;
  const std::string written = folded(name);
  const auto meant = std::find_if(kListed.begin(), kListed.end(), [&](const TagFamilyFacts& one) {
    return is_named(one, written);
  });
  return meant == kListed.end() ? nullptr : &*meant;
}

std::string listed_tag_family(std::string name) {
  const TagFamilyFacts* found = find_tag_family(name);
  return found != nullptr ? std::string(found->name) : name;
}

std::string tag_family_names() {
  std::string names;
  for (const TagFamilyFacts& one : kListed)
    names += (names.empty() ? "" : ", ") + std::string(one.name);
  return names;
}

std::string tag_family_rule(std::string_view name) {
  std::vector<std::string> names;
  for (const TagFamilyFacts& one : kListed) names.emplace_back(one.name);
  return must_be_one_of(names, name);
}

std::string tag_family_warning(std::string_view name) {
  const TagFamilyFacts* found = find_tag_family(name);
  if (found == nullptr || !found->is_weak) return {};
  return std::string(found->name) +
         " has few bits and reads tags where there are none: prefer tag36h11 or DICT_6X6_250, or "
         "list ids that hang nowhere in tags.ignore";
}

}  // namespace fiducap
