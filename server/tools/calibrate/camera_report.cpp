#include "tools/calibrate/camera_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <nlohmann/json.hpp>

#include "capture/lens/lens_name.hpp"

namespace fiducap {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

std::array<const char*, kLensNumbers> number_names(Distortion kind) {
  if (kind == Distortion::kEquidistant)
    return {"fu", "fv", "cu", "cv", "k1", "k2", "k3", "k4", "-"};
  return {"fu", "fv", "cu", "cv", "k1", "k2", "p1", "p2", "k3"};
}

const char* word_for(IntrinsicsGrade grade) {
  return grade == IntrinsicsGrade::kGood   ? "good"
         : grade == IntrinsicsGrade::kWeak ? "weak"
                                           : "useless";
}

nlohmann::ordered_json numbers_json(const IntrinsicsCalibration& c) {
  nlohmann::ordered_json out;
  const auto names = number_names(c.state.camera.distortion);
  const LensVector values = numbers_of(c.state.camera);
  for (const int i : c.free)
    out[names[static_cast<std::size_t>(i)]] = {
        {"value", values(i)}, {"sigma", std::sqrt(c.uncertainty.covariance(i, i))}};
  return out;
}

std::vector<std::string> names_of(const std::vector<int>& numbers, Distortion kind) {
  std::vector<std::string> out;
  for (const int i : numbers) out.emplace_back(number_names(kind)[static_cast<std::size_t>(i)]);
  return out;
}

/// Coefficients that the images do not show.
std::vector<std::string> held_names(const IntrinsicsCalibration& c) {
  const Distortion kind = c.state.camera.distortion;
  std::vector<int> held;
  for (int i = 4; i < (kind == Distortion::kEquidistant ? 8 : kLensNumbers); ++i)
    if (std::find(c.free.begin(), c.free.end(), i) == c.free.end()) held.push_back(i);
  return names_of(held, kind);
}

nlohmann::ordered_json checks_json(const IntrinsicsCalibration& c, const IntrinsicsVerdict& v) {
  const HeldOut& held_out = c.held_out;
  const TargetShape& board = c.shape;
  nlohmann::ordered_json out{{"image_folded", v.shape.folded},
                             {"focal_ratio", v.shape.aspect},
                             {"principal_point_off", v.shape.centre_off},
                             {"focal_sigma", v.focal_sigma},
                             {"focal_scatter", c.uncertainty.focal_scatter},
                             {"condition", c.uncertainty.condition},
                             {"tilt_deg", v.tilt_rad / kDegree},
                             {"depth_spread", v.depth_spread},
                             {"targets_that_do_not_fit", c.misfits}};
  if (held_out.tried)
    out["held_out"] = {{"ratio", held_out.ratio},
                       {"first_focal", held_out.first_focal},
                       {"second_focal", held_out.second_focal},
                       {"step_sigma", held_out.focal_step_sigma()}};
  if (board.known)
    out["board"] = {{"bend", board.bend},
                    {"bend_sigma", board.bend_sigma},
                    {"stretch", board.stretch},
                    {"stretch_sigma", board.stretch_sigma}};
  return out;
}

nlohmann::ordered_json cells_json(const ImageMap& map) {
  nlohmann::ordered_json cells = nlohmann::ordered_json::array();
  for (const ImageCell& cell : map.cells)
    cells.push_back({{"centre_px", {cell.centre_px.x(), cell.centre_px.y()}},
                     {"corners", cell.points},
                     {"reprojection_rms_px", cell.rms_px},
                     {"reprojection_mean_px", {cell.mean_px.x(), cell.mean_px.y()}},
                     {"uncertainty_px", cell.in_lens ? nlohmann::ordered_json(cell.uncertainty_px)
                                                     : nlohmann::ordered_json(nullptr)}});
  return {{"columns", map.columns}, {"rows", map.rows}, {"cells", cells}};
}

void print_lens(const Terminal& terminal, const IntrinsicsCalibration& c) {
  terminal.out << "  lens " << name_of(c.state.camera.distortion);
  for (std::size_t i = 0; i < c.trials.size(); ++i)
    terminal.out << (i == 0 ? ": " : "; " + name_of(c.trials[i].distortion) + ": ")
                 << fixed(c.trials[i].sigma_px, 3) << " px unexplained";
  terminal.out << "\n";
  const auto names = number_names(c.state.camera.distortion);
  const LensVector values = numbers_of(c.state.camera);
  for (const int i : c.free) {
    const int decimals = i < 4 ? 3 : 5;
    terminal.out << "    " << names[static_cast<std::size_t>(i)] << "  "
                 << fixed(values(i), decimals) << " ± "
                 << fixed(std::sqrt(c.uncertainty.covariance(i, i)), decimals)
                 << (i < 4 ? " px" : "") << "\n";
  }
  std::string held;
  for (const std::string& name : held_names(c)) held += (held.empty() ? "" : ", ") + name;
  if (!held.empty()) terminal.out << "    " << held << "  held at 0: the images do not show more\n";
}

}  // namespace

std::string to_camera_json(const CameraOutcome& o) {
  const IntrinsicsCalibration& c = o.calibration;
  const IntrinsicsVerdict& v = o.verdict;
  nlohmann::ordered_json trials = nlohmann::ordered_json::array();
  for (const LensTrial& trial : c.trials)
    trials.push_back({{"lens", name_of(trial.distortion)},
                      {"numbers", names_of(trial.free, trial.distortion)},
                      {"sigma_px", trial.sigma_px},
                      {"can_be_a_lens", trial.sound}});
  const nlohmann::ordered_json report{
      {"verdict", word_for(v.grade)},
      {"advice", v.advice},
      {"lens", name_of(c.state.camera.distortion)},
      {"resolution", {c.data.width, c.data.height}},
      {"numbers", numbers_json(c)},
      {"held_at_zero", held_names(c)},
      {"checks", checks_json(c, v)},
      {"images", {{"looked_at", o.images}, {"with_target", o.with_target}, {"used", v.images}}},
      {"sightings", {{"used", v.sightings}, {"rejected", c.rejected}}},
      {"targets_stood_still", c.targets_stood_still},
      {"targets_disagree", c.targets_disagree},
      {"noise_if_they_stood_still_px", c.joined_sigma_px},
      {"covered", v.covered},
      {"seen_angle_deg", v.seen_angle_rad / kDegree},
      {"image_angle_deg", v.image_angle_rad / kDegree},
      {"tilted", v.tilted},
      {"reprojection_rms_px", v.reprojection_rms_px},
      {"noise_px", c.sigma_px},
      {"noise_correlation", c.uncertainty.correlation},
      {"misfit_px", v.misfit_px},
      {"uncertainty_px", {{"median", v.uncertainty_median_px}, {"worst", v.uncertainty_worst_px}}},
      {"lens_error_px", v.lens_error_px},
      {"lenses_tried", trials},
      {"map", cells_json(o.map)}};
  return report.dump(2) + "\n";
}

void print_camera_report(const Terminal& terminal, const CameraOutcome& o,
                         const std::string& input) {
  const IntrinsicsCalibration& c = o.calibration;
  const IntrinsicsVerdict& v = o.verdict;
  terminal.out << input << ": " << o.images << " images, " << o.with_target << " with targets, "
               << v.images << " used (sharp and different), " << v.sightings << " sightings, "
               << c.rejected << " rejected\n";
  print_lens(terminal, c);
  if (c.targets_stood_still)
    terminal.out << "  the tags stand still relative to each other; that was used\n";
  if (c.targets_disagree)
    terminal.out << "  taken together the tags leave " << fixed(c.joined_sigma_px, 2)
                 << " px (moved, not flat, or sizes not as said): each sighting by itself\n";
  terminal.out << "  coverage " << fixed(100 * v.covered, 0) << " % of the image, up to "
               << fixed(v.seen_angle_rad / kDegree, 0) << "° of "
               << fixed(v.image_angle_rad / kDegree, 0) << "° off the axis; "
               << fixed(100 * v.tilted, 0) << " % of the sightings tilted\n"
               << "  reprojection " << fixed(v.reprojection_rms_px, 3) << " px RMS\n"
               << "  directions uncertain by " << fixed(v.uncertainty_median_px, 3)
               << " px in half of the image, " << fixed(v.uncertainty_worst_px, 3)
               << " px at worst\n";
  const std::string words = v.grade == IntrinsicsGrade::kGood   ? "good enough"
                            : v.grade == IntrinsicsGrade::kWeak ? "usable, could be better"
                                                                : "refused, record again";
  terminal.out << "verdict: " << words << "\n";
  for (const std::string& advice : v.advice) terminal.out << "  - " << advice << "\n";
}

std::string to_camera_yaml(const IntrinsicsCalibration& calibration,
                           const IntrinsicsVerdict& verdict) {
  const CameraModel& camera = calibration.state.camera;
  const LensVector values = numbers_of(camera);
  const auto names = number_names(camera.distortion);
  CameraMount told;
  tell_lens(calibration, verdict, told);
  std::string sigmas;
  for (const int i : calibration.free)
    sigmas += std::string(" ") + names[static_cast<std::size_t>(i)] + " " +
              fixed(std::sqrt(calibration.uncertainty.covariance(i, i)), i < 4 ? 4 : 6);
  // OpenCV's order k1 k2 p1 p2 k3; EuRoC leaves k3 out where it is zero.
  const int coefficients =
      camera.distortion == Distortion::kRadialTangential && values(8) != 0 ? 5 : 4;
  const auto list = [&](int first, int count, int decimals) {
    std::string text = "[";
    for (int i = first; i < first + count; ++i)
      text += (i == first ? "" : ", ") + fixed(values(i), decimals);
    return text + "]";
  };
  return "# Intrinsics by fiducap calibrate camera; verdict: " +
         std::string(word_for(verdict.grade)) + "\n# " + std::to_string(verdict.images) +
         " images, reprojection " + fixed(verdict.reprojection_rms_px, 3) + " px RMS, coverage " +
         fixed(100 * verdict.covered, 0) + " %\n# 1-sigma:" + sigmas +
         "\nintrinsics_sigma: {focal: " + fixed(told.focal_sigma, 6) +
         ", centre_px: " + fixed(told.centre_sigma_px, 4) + ", k1: " + fixed(told.k1_sigma, 6) +
         "}\nlens_error_px: " + fixed(told.lens_error_px, 3) +
         "  # the same wherever in the image a tag was before\ncamera_model: pinhole\nresolution: "
         "[" +
         std::to_string(camera.width) + ", " + std::to_string(camera.height) +
         "]\nintrinsics: " + list(0, 4, 6) + "\ndistortion_model: " + name_of(camera.distortion) +
         "\ndistortion_coefficients: " + list(4, coefficients, 9) + "\n";
}

}  // namespace fiducap
