#pragma once

#include <memory>
#include <string>
#include <vector>

#include "detection/tag_detector.hpp"
#include "detection/tag_family.hpp"

namespace fiducap {

/// For TagFamily::named: the tags of Kalibr's AprilGrid, which are tag36h11 in a black border of
/// two cells instead of one. In no list of families: their corners touch black squares, so that
/// only AprilGridSearch finds them all.
inline constexpr const char* kAprilGridFamily = "Kalibr's AprilGrid";

/// The family whose tags are the same with their corners turned by half a turn: OpenCV's print of
/// libapriltag's, and the other way round. Empty: there is none.
[[nodiscard]] std::string half_turned_family(const std::string& family);

/// A tag of any listed family or of kAprilGridFamily.
struct FamilySighting {
  const TagFamilyFacts* family{};
  TagSighting tag;  ///< Its corners are not fitted.
};

/// Reads tags of all families with one search for quads, to find out which are printed. Corrects no
/// bits and needs no margin, so that weak families yield false tags. Building it is slow.
class AnyFamilyDetector final {
 public:
  AnyFamilyDetector();
  ~AnyFamilyDetector();

  /// Appends to `out`.
  void detect(const GrayImage& image, const DetectionPass& pass, std::vector<FamilySighting>& out);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
