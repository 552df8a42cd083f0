#include "tools/calibrate/calibrate_camera_command.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <numbers>

#include <nlohmann/json.hpp>

#include "capture/lens/lens_name.hpp"
#include "detection/tag_family_list.hpp"
#include "tools/calibrate/calibration_picture.hpp"
#include "tools/calibrate/calibration_views.hpp"
#include "tools/whole_file.hpp"

namespace fiducap {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kUsualTag_mm = 160;

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

/// "9x6" → columns and rows of inner corners.
Expected<Checkerboard> read_checkerboard(const CalibrateCameraArguments& arguments) {
  const std::string& text = arguments.checkerboard;
  Checkerboard board{0, 0, arguments.square_mm / 1000};
  const char* end = text.data() + text.size();
  const auto columns = std::from_chars(text.data(), end, board.columns);
  if (columns.ec == std::errc() && columns.ptr != end && *columns.ptr == 'x') {
    const auto rows = std::from_chars(columns.ptr + 1, end, board.rows);
    constexpr int kLeast = 3, kMost = 100;
    const auto fits = [](int n) { return n >= kLeast && n <= kMost; };
    if (rows.ec == std::errc() && rows.ptr == end && fits(board.columns) && fits(board.rows))
      return board;
  }
  return fail(ErrorCode::kInvalid,
              "must be COLUMNSxROWS of inner corners (one less than squares), 3 to 100 each, e.g. "
              "9x6; is '" +
                  text + "'",
              "--checkerboard");
}

Expected<CalibrationTargets> choose_targets(const CalibrateCameraArguments& arguments,
                                            const CalibrationImages& images) {
  CalibrationTargets targets;
  if (!arguments.checkerboard.empty()) {
    auto board = read_checkerboard(arguments);
    if (!board) return tl::unexpected(board.error());
    targets.checkerboard = *board;
    return targets;
  }
  targets.tags.size_m = kUsualTag_mm / 1000;
  if (const auto& recording = images.recording()) targets.tags = tags_of(*recording);
  if (arguments.tag_mm > 0) {
    targets.tags.size_m = arguments.tag_mm / 1000;
    targets.tags.sizes_m.clear();
  }
  if (!arguments.family.empty()) targets.tags.family = listed_tag_family(arguments.family);
  if (const auto faults = targets.tags.check(); !faults.empty())
    return fail(ErrorCode::kInvalid, faults.front().text());
  return targets;
}

IntrinsicsOptions options_of(const CalibrateCameraArguments& arguments) {
  IntrinsicsOptions options;
  if (arguments.lens == "equidistant") options.lenses = {Distortion::kEquidistant};
  if (arguments.lens == "radial-tangential") options.lenses = {Distortion::kRadialTangential};
  options.join_targets = !arguments.loose;
  return options;
}

/// What a run has to show.
struct Outcome {
  std::size_t images{};
  std::size_t with_target{};
  IntrinsicsCalibration calibration;
  ImageMap map;
  IntrinsicsVerdict verdict;
};

Error nothing_seen(const CollectedViews& seen, const CalibrateCameraArguments& arguments) {
  const std::string target = arguments.checkerboard.empty()
                                 ? "no tag of 20 px or more (family, light, sharpness?)"
                                 : "no whole checkerboard of " + arguments.checkerboard +
                                       " inner corners (count them; all must be in view)";
  return {ErrorCode::kNotFound, target + " in " + std::to_string(seen.images) + " images",
          arguments.input};
}

Expected<Outcome> calibrate(const CalibrateCameraArguments& arguments, const Terminal& terminal) {
  auto images =
      CalibrationImages::open(arguments.input, static_cast<std::size_t>(arguments.camera));
  if (!images) return tl::unexpected(images.error());
  const auto targets = choose_targets(arguments, *images);
  if (!targets) return tl::unexpected(targets.error());
  ProgressLine line(terminal);
  const std::string of =
      images->total() > 0 ? " of " + std::to_string(images->total()) : std::string();
  const auto seen = collect_views(*images, *targets, [&](std::size_t looked, std::size_t found) {
    line.show("looking for targets: " + std::to_string(looked) + of + " images, " +
              std::to_string(found) + " with");
  });
  if (!seen) return tl::unexpected(seen.error());
  if (seen->data.views.empty()) return tl::unexpected(nothing_seen(*seen, arguments));
  const auto data = select_views(seen->data, static_cast<std::size_t>(arguments.views));
  auto result = calibrate_intrinsics(data, options_of(arguments),
                                     [&](const std::string& what) { line.show(what); });
  if (!result) {
    Error error = result.error();
    if (error.context.empty()) error.context = arguments.input;
    return tl::unexpected(error);
  }
  Outcome out{seen->images, seen->data.views.size(), std::move(*result), {}, {}};
  out.map = make_image_map(out.calibration);
  out.verdict = judge(out.calibration, out.map);
  return out;
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

std::string json_report(const Outcome& o) {
  const IntrinsicsCalibration& c = o.calibration;
  const IntrinsicsVerdict& v = o.verdict;
  nlohmann::ordered_json trials = nlohmann::ordered_json::array();
  for (const LensTrial& trial : c.trials)
    trials.push_back({{"lens", name_of(trial.distortion)},
                      {"k3", trial.third_radial},
                      {"sigma_px", trial.sigma_px}});
  const nlohmann::ordered_json report{
      {"verdict", word_for(v.grade)},
      {"advice", v.advice},
      {"lens", name_of(c.state.camera.distortion)},
      {"resolution", {c.data.width, c.data.height}},
      {"numbers", numbers_json(c)},
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
      {"lenses_tried", trials},
      {"map", cells_json(o.map)}};
  return report.dump(2) + "\n";
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
}

void print_report(const Terminal& terminal, const Outcome& o, const std::string& input) {
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
                                                                : "do not use, record again";
  terminal.out << "verdict: " << words << "\n";
  for (const std::string& advice : v.advice) terminal.out << "  - " << advice << "\n";
}

}  // namespace

std::string to_camera_yaml(const IntrinsicsCalibration& calibration,
                           const IntrinsicsVerdict& verdict) {
  const CameraModel& camera = calibration.state.camera;
  const LensVector values = numbers_of(camera);
  const auto names = number_names(camera.distortion);
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
         "\ncamera_model: pinhole\nresolution: [" + std::to_string(camera.width) + ", " +
         std::to_string(camera.height) + "]\nintrinsics: " + list(0, 4, 6) +
         "\ndistortion_model: " + name_of(camera.distortion) +
         "\ndistortion_coefficients: " + list(4, coefficients, 9) + "\n";
}

int run_calibrate_camera(const CalibrateCameraArguments& arguments, const Terminal& terminal) {
  const auto outcome = calibrate(arguments, terminal);
  if (!outcome) return report(terminal, outcome.error());
  const std::filesystem::path out(arguments.out);
  const std::string picture = (out / "camera.svg").string();
  const std::string file = (out / "camera.yaml").string();
  const bool useful = outcome->verdict.grade != IntrinsicsGrade::kUseless;
  auto written = write_whole_file(
      picture, calibration_svg(outcome->calibration, outcome->map, outcome->verdict));
  if (written && useful)
    written = write_whole_file(file, to_camera_yaml(outcome->calibration, outcome->verdict));
  if (!written) return report(terminal, written.error());
  if (arguments.json)
    terminal.out << json_report(*outcome);
  else
    print_report(terminal, *outcome, arguments.input);
  if (!useful)
    return report(terminal, {ErrorCode::kInvalid,
                             "no calibration written; " + picture + " shows what is missing",
                             arguments.input});
  if (!arguments.json)
    terminal.out << "written: " << file << " (bodies: cameras: calibration), " << picture << "\n";
  return kExitOk;
}

}  // namespace fiducap
