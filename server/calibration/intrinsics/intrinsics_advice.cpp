#include <array>
#include <cmath>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "calibration/intrinsics/intrinsics_verdict.hpp"

namespace fiducap {
namespace {

// Limits of a good calibration. The lens should add less error than the detector (0.1 to 0.3 px);
// 0.2 % of focal length is 6 mm at 3 m.
constexpr int kGoodImages = 20;
constexpr double kGoodCovered = 0.8;
constexpr double kGoodTilted = 0.2;
constexpr double kGoodFocal = 2e-3;
constexpr double kGoodUncertainty_px = 0.3;
constexpr double kGoodRms_px = 1.0;
constexpr double kGoodMisfit_px = 0.15;
constexpr double kGoodCentreOff = 0.1;
constexpr double kGoodBend = 2e-3;  // 1 mm of a board of half a metre
constexpr double kGoodScatter = 3;
constexpr double kGoodHeldOut = 1.25;
// Limits of a usable calibration.
constexpr double kUselessCovered = 0.25;
constexpr double kUselessFocal = 0.02;
constexpr double kUselessCentre = 0.05;
constexpr double kUselessUncertainty_px = 5;  // median over the image
constexpr double kUselessRms_px = 5;
constexpr double kUselessTilt_rad = 8 * kDegree;  // apparent tilt of a parallel board by noise
constexpr double kUselessBend = 0.02;
constexpr double kUselessFocalStep = 0.02;
constexpr double kUselessHeldOut = 2;
constexpr double kSignificant_sigma = 5;  // of a bend or a step

std::string percent(double share, int decimals = 0) { return fixed(100 * share, decimals) + " %"; }

/// Parts of the image, a third of its width and height each, with less than half of their cells
/// covered.
std::vector<std::string> empty_parts(const ImageMap& map) {
  constexpr std::array<const char*, 9> kParts{
      "upper left corner", "upper edge",        "upper right corner", "left edge",         "middle",
      "right edge",        "lower left corner", "lower edge",         "lower right corner"};
  std::array<int, 9> cells{};
  std::array<int, 9> covered{};
  for (int row = 0; row < map.rows; ++row)
    for (int column = 0; column < map.columns; ++column) {
      const auto part =
          static_cast<std::size_t>(3 * (3 * row / map.rows) + 3 * column / map.columns);
      ++cells[part];
      covered[part] += map.at(column, row).points >= kCoveringPoints ? 1 : 0;
    }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kParts.size(); ++i)
    if (2 * covered[i] < cells[i]) names.emplace_back(kParts[i]);
  return names;
}

std::string listed(const std::vector<std::string>& names, const std::string& article) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " + article : ", " + article) + names[i];
  return text;
}

bool is_significant(double value, double sigma) {
  return std::abs(value) > kSignificant_sigma * sigma;
}

/// Grades and collects the advice.
class Grader final {
 public:
  Grader(const IntrinsicsCalibration& c, const ImageMap& map, IntrinsicsVerdict& v)
      : c_(c), map_(map), v_(v), camera_(c.state.camera), board_(c.shape), held_(c.held_out) {}

  void refuse_by_board() {
    refuse(board_.bend > kUselessBend && is_significant(board_.bend, board_.bend_sigma),
           bend_words());
    refuse(std::abs(board_.stretch) > kUselessBend &&
               is_significant(board_.stretch, board_.stretch_sigma),
           stretch_words());
  }

  void refuse_by_lens() {
    refuse(v_.shape.folded > kMostFolded,
           "No lens does this: " + percent(v_.shape.folded) +
               " of the image is folded (the distortion maps two directions to one pixel). The "
               "images do not determine the lens there: bring the target to the edges and corners, "
               "nearer and tilted, or choose the other lens (--lens).");
    const bool square = v_.shape.pixel_aspect == 1;
    refuse(v_.shape.aspect_off > (square ? kMostAspectOff : kMostOddAspectOff),
           "Focal lengths of " + fixed(camera_.fu, 0) + " and " + fixed(camera_.fv, 0) +
               " px are impossible: no camera has such pixels (" + fixed(v_.shape.aspect, 3) +
               " to 1). Tilt the target by 30° to 50° about both its axes, at several distances, "
               "and measure its sides.");
    refuse(v_.shape.centre_off > kMostCentreOff,
           "The optical axis would be at pixel (" + fixed(camera_.cu, 0) + ", " +
               fixed(camera_.cv, 0) +
               "), far from the middle of the image: more views, tilted and rotated by 90°. (It "
               "may be right for an image cut out of a larger one: --force.)");
  }

  void refuse_by_views() {
    refuse(v_.focal_sigma > kUselessFocal,
           "The focal length is known to " + percent(v_.focal_sigma, 1) +
               " only: tilt the board by 30° to 50° to all sides, at several distances.");
    refuse(v_.tilt_rad < kUselessTilt_rad,
           "The target was held parallel to the image (nine tenths of the views within " +
               fixed(v_.tilt_rad / kDegree, 0) +
               "°): such views fit any focal length. Tilt it by 30° to 50° to all sides.");
    refuse(v_.centre_sigma > kUselessCentre,
           "The principal point is known to " + fixed(v_.centre_sigma * camera_.width, 0) +
               " px only: more views, tilted and rotated by 90°.");
    refuse(v_.covered < kUselessCovered,
           "Only " + percent(v_.covered) +
               " of the image was seen: bring the target to all parts of it, edges and corners "
               "too.");
    refuse(v_.uncertainty_median_px > kUselessUncertainty_px,
           "Directions are uncertain by " + fixed(v_.uncertainty_median_px, 1) +
               " px in half of the image: more images, nearer and more tilted.");
  }

  void refuse_by_fit() {
    refuse(v_.reprojection_rms_px > kUselessRms_px,
           "Corners are " + fixed(v_.reprojection_rms_px, 1) +
               " px off: check the description of the target (" + c_.data.targets.front().name +
               " …), and that the lens is a pinhole with radial-tangential or equidistant "
               "distortion.");
    refuse(focal_moved(kUselessFocalStep), focal_words());
    refuse(held_.tried && held_.ratio > kUselessHeldOut, held_out_words());
  }

  void weaken_by_views() {
    const auto parts = empty_parts(map_);
    if (v_.covered >= kUselessCovered)
      weaken(v_.covered < kGoodCovered || !parts.empty(),
             parts.empty()
                 ? percent(v_.covered) + " of the image was seen: fill the gaps."
                 : percent(v_.covered) + " of the image was seen: move the target into the " +
                       listed(parts, "the ") + ".");
    weaken(v_.tilt_rad >= kUselessTilt_rad && v_.tilted < kGoodTilted,
           "Only " + percent(v_.tilted) +
               " of the sightings are tilted: tilt the target by 30° to 50° to all sides.");
    weaken(v_.focal_sigma <= kUselessFocal && v_.focal_sigma > kGoodFocal,
           "The focal length is uncertain by " + percent(v_.focal_sigma, 2) +
               ": bring the target nearer, so that it fills the image, and tilt it.");
    weaken(v_.uncertainty_worst_px > kGoodUncertainty_px,
           "Directions are uncertain by up to " + fixed(v_.uncertainty_worst_px, 2) +
               " px (see the picture where): more corners there.");
    weaken(v_.images < kGoodImages,
           std::to_string(v_.images) + " different images: record more, 50 are enough.");
    weaken(v_.image_angle_rad > 0 && v_.seen_angle_rad < 0.85 * v_.image_angle_rad,
           "Corners were seen up to " + fixed(v_.seen_angle_rad / kDegree, 0) +
               "° off the axis, the image reaches " + fixed(v_.image_angle_rad / kDegree, 0) +
               "°: beyond, the lens is extrapolated.");
  }

  void weaken_by_lens() {
    weaken(v_.shape.folded > 0 && v_.shape.folded <= kMostFolded,
           "The lens model ends before the corners of the image: nothing is seen there.");
    weaken(v_.shape.pixel_aspect != 1 && v_.shape.aspect_off <= kMostOddAspectOff,
           "Pixels are not square (" + fixed(v_.shape.aspect, 3) +
               " to 1): right only if the camera's video mode stretches the image.");
    weaken(v_.shape.centre_off > kGoodCentreOff && v_.shape.centre_off <= kMostCentreOff,
           "The principal point is " + percent(v_.shape.centre_off) +
               " of the image off its middle: is the image cut out of a larger one?");
  }

  void weaken_by_fit() {
    weaken(v_.reprojection_rms_px <= kUselessRms_px && v_.reprojection_rms_px > kGoodRms_px,
           "Corners are " + fixed(v_.reprojection_rms_px, 2) +
               " px off: move slowly, light the room, use a flat target.");
    weaken(v_.misfit_px > kGoodMisfit_px,
           "The residuals of a part of the image agree with each other (" + fixed(v_.misfit_px, 2) +
               " px): the target is not flat or of another size, rolling shutter, or a lens "
               "that this model does not fit.");
    weaken(board_.bend > kGoodBend && board_.bend <= kUselessBend &&
               is_significant(board_.bend, board_.bend_sigma),
           bend_words());
    weaken(std::abs(board_.stretch) > kGoodBend && std::abs(board_.stretch) <= kUselessBend &&
               is_significant(board_.stretch, board_.stretch_sigma),
           stretch_words());
    weaken(focal_moved(kGoodFocal) && !focal_moved(kUselessFocalStep), focal_words());
    weaken(c_.uncertainty.focal_scatter > kGoodScatter,
           "The images disagree about the focal length, " + fixed(c_.uncertainty.focal_scatter, 1) +
               " times as much as their noise explains: switch autofocus and zoom off, hold still "
               "(rolling shutter), use a flat target.");
    weaken(held_.tried && held_.ratio > kGoodHeldOut && held_.ratio <= kUselessHeldOut,
           held_out_words());
    weaken_by_tags();
  }

 private:
  void weaken_by_tags() {
    weaken(!c_.misfits.empty(),
           "Most sightings of " + listed(c_.misfits, "") +
               " do not fit the others: of another size, moved, or printed twice?");
    weaken(c_.targets_disagree && c_.misfits.empty(),
           "The residuals are " + fixed(c_.joined_sigma_px, 2) +
               " px with the tags in constant places, " + fixed(c_.sigma_px, 2) +
               " px with each by itself: one moved, the paper is not flat, or sizes are wrong.");
  }

  void refuse(bool wrong, const std::string& text) {
    if (!wrong) return;
    v_.grade = IntrinsicsGrade::kUseless;
    v_.advice.push_back(text);
  }
  void weaken(bool wrong, const std::string& text) {
    if (!wrong) return;
    if (v_.grade == IntrinsicsGrade::kGood) v_.grade = IntrinsicsGrade::kWeak;
    v_.advice.push_back(text);
  }

  [[nodiscard]] bool focal_moved(double share) const {
    return held_.first_focal > 0 && std::abs(held_.focal_step() - 1) > share &&
           held_.focal_step_sigma() > kSignificant_sigma;
  }
  [[nodiscard]] std::string focal_words() const {
    return "The focal length was " + fixed(held_.first_focal, 0) +
           " px in the first half of the images and " + fixed(held_.second_focal, 0) +
           " px in the second: switch autofocus off and do not touch the zoom.";
  }
  [[nodiscard]] std::string held_out_words() const {
    return "Images that were left out fit " + fixed(held_.ratio, 1) +
           " times worse than those the lens was fitted to: more different views, or fewer terms "
           "(--lens).";
  }
  [[nodiscard]] std::string bend_words() const {
    return "The " + board_.name + " is bent by about " + percent(board_.bend, 1) +
           " of its longer side: glue it to a flat plate.";
  }
  [[nodiscard]] std::string stretch_words() const {
    return "The " + board_.name + " has other proportions: its sides x to y are " +
           fixed(1 + board_.stretch, 3) +
           " times the given ones. Measure both; printers scale, and not always evenly.";
  }

  const IntrinsicsCalibration& c_;
  const ImageMap& map_;
  IntrinsicsVerdict& v_;
  const CameraModel& camera_;
  const TargetShape& board_;
  const HeldOut& held_;
};

}  // namespace

void add_advice(const IntrinsicsCalibration& calibration, const ImageMap& map,
                IntrinsicsVerdict& verdict) {
  Grader grader(calibration, map, verdict);
  grader.refuse_by_board();
  grader.refuse_by_lens();
  grader.refuse_by_views();
  grader.refuse_by_fit();
  grader.weaken_by_views();
  grader.weaken_by_lens();
  grader.weaken_by_fit();
}

}  // namespace fiducap
