#include "tools/camera/picture_picker.hpp"

#include <algorithm>

#include "capture/image_traits.hpp"

namespace fiducap {
namespace {

constexpr double kLeastSide = 20;            // px, as `calibrate camera` wants it
constexpr int kQuicklySearched = 800 * 600;  // larger images in every second pixel
constexpr double kSharp = 0.5;               // ImageTraits; the same as ImageWatch's
constexpr double kFarApart = 0.05;           // of the image width, mean over shared corners

bool is_large(const TagSighting& tag) {
  for (std::size_t i = 0; i < 4; ++i)
    if (!((tag.corners_px[i] - tag.corners_px[(i + 1) % 4]).norm() >= kLeastSide)) return false;
  return true;
}

}  // namespace

PicturePicker::PicturePicker(const TagSetConfig& tags) : tags_(tags) {}

PicturePicker::Corners PicturePicker::corners_in(const CameraFrame& frame) {
  if (!detector_) {
    DetectorConfig config;
    config.decimate = frame.image->width * frame.image->height > kQuicklySearched ? 2.0 : 1.0;
    detector_ = std::make_unique<TagDetector>(tags_, config);
  }
  Corners corners;
  for (const TagSighting& tag : detector_->detect(frame).tags)
    if (is_large(tag)) corners[tag.tag_id] = tag.corners_px;
  return corners;
}

PicturePicker::Verdict PicturePicker::look(const CameraFrame& frame) {
  const ImageTraits measures = traits_of(*frame.image);
  const auto is_smeared = [](double sharpness) { return sharpness > 0 && sharpness < kSharp; };
  if (is_smeared(measures.across) || is_smeared(measures.down)) return Verdict::kSmeared;
  Corners corners = corners_in(frame);
  if (corners.empty()) return Verdict::kNoTag;
  for (const Corners& before : taken_) {
    double sum = 0;
    int count = 0;
    for (const auto& [id, now] : corners) {
      const auto then = before.find(id);
      if (then == before.end()) continue;
      for (std::size_t i = 0; i < 4; ++i) sum += (now[i] - then->second[i]).norm();
      count += 4;
    }
    if (count > 0 && sum / count < kFarApart * frame.image->width) return Verdict::kAlike;
  }
  taken_.push_back(std::move(corners));
  return Verdict::kTaken;
}

std::string_view advice_for(PicturePicker::Verdict verdict) {
  switch (verdict) {
    case PicturePicker::Verdict::kTaken:
      return "taken; now from another side, distance or angle";
    case PicturePicker::Verdict::kNoTag:
      return "no tag with sides of 20 px: nearer, more light, or another --family?";
    case PicturePicker::Verdict::kSmeared:
      return "not sharp: hold still for a moment";
    case PicturePicker::Verdict::kAlike:
      break;
  }
  return "like one that was taken: move on, turn, tilt, fill the corners of the image";
}

}  // namespace fiducap
