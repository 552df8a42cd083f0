#include <algorithm>
#include <array>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "base/whole_file.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "daemon/system.hpp"
#include "tools/calibrate/calibrate.hpp"
#include "tools/replay/replay_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

constexpr double kGoodTime_s = 0.001;
constexpr double kSurprising_sigma = 3;
constexpr std::array<const char*, 6> kAxes{"x", "y", "z", "rotation x", "rotation y", "rotation z"};

Expected<CameraImuCalibration> calibrate(const CalibrateExtrinsicsArguments& arguments,
                                         const Terminal& terminal) {
  const auto info = read_recording_info(arguments.recording);
  if (!info) return tl::unexpected(info.error());
  if (auto usable = require_usable(*info, terminal); !usable) return tl::unexpected(usable.error());
  const SystemClock clock;
  const auto source = open_recording(*info, {}, clock);
  if (!source) return tl::unexpected(source.error());
  const OfflineSetup setup = offline_setup(*info);
  ProgressLine line(terminal);
  const auto samples = load_samples(setup, **source, [&](std::size_t images) {
    line.show("finding tags: " + std::to_string(images) + " images");
  });
  if (!samples) return tl::unexpected(samples.error());
  CalibrationOptions options;
  options.position_sigma_m = arguments.prior_mm / 1000;
  options.rotation_sigma_rad = arguments.prior_deg * kDegree;
  options.search_time = !arguments.keep_time;
  auto result = calibrate_camera_imu(setup, *samples, options,
                                     [&](const std::string& what) { line.show(what); });
  if (!result) return tl::unexpected(in_context(result.error(), arguments.recording));
  return result;
}

bool time_is_good(const CameraImuCalibration& c) {
  return c.time.determined && !c.time.at_border && c.time.sigma_s < kGoodTime_s;
}

bool is_good(const CameraImuCalibration& c, bool time_searched) {
  if (c.begins_in_motion || (time_searched && !time_is_good(c))) return false;
  return std::ranges::all_of(c.verdicts, [](const CameraVerdict& camera) {
    return std::ranges::all_of(camera.axes, &AxisVerdict::observed);
  });
}

nlohmann::ordered_json camera_json(const CameraVerdict& verdict, const CameraMount& mount) {
  const Eigen::Vector3d& p = verdict.X_BV.p;
  const Eigen::Quaterniond& q = verdict.X_BV.q;
  nlohmann::ordered_json sigmas = nlohmann::ordered_json::array();
  nlohmann::ordered_json weak = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < verdict.axes.size(); ++i) {
    sigmas.push_back(verdict.axes[i].sigma);
    if (!verdict.axes[i].observed)
      weak.push_back({{"axis", kAxes[i]}, {"motion", motion_for_axis(i)}});
  }
  return {{"position_m", {p.x(), p.y(), p.z()}},
          {"orientation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
          {"sigma_m_rad", sigmas},
          {"not_observed", weak},
          {"moved_m", verdict.moved_m},
          {"moved_rad", verdict.moved_rad},
          {"timeshift_cam_imu_s", to_seconds(mount.time_shift)}};
}

nlohmann::ordered_json json_report(const CameraImuCalibration& c, bool time_searched) {
  nlohmann::ordered_json cameras = nlohmann::ordered_json::array();
  for (std::size_t k = 0; k < c.cameras.size(); ++k)
    cameras.push_back(camera_json(c.verdicts[k], c.cameras[k]));
  nlohmann::ordered_json report{{"cameras", cameras},
                                {"verdict", is_good(c, time_searched) ? "good" : "weak"},
                                {"begins_in_motion", c.begins_in_motion}};
  if (time_searched)
    report["time"] = {{"shift_s", c.time.shift_s},
                      {"sigma_s", c.time.sigma_s},
                      {"determined", c.time.determined},
                      {"at_border", c.time.at_border}};
  report["residuals"] = {{"reprojection_median_px", c.statistics.reprojection_median_px},
                         {"reprojection_p95_px", c.statistics.reprojection_p95_px},
                         {"nis_per_dof", c.statistics.nis_per_dof()},
                         {"tags_used", c.statistics.tags_used},
                         {"tags_rejected", c.statistics.tags_rejected}};
  report["filter_runs"] = c.runs;
  return report;
}

void print_camera(const Terminal& terminal, std::size_t k, const CameraVerdict& v,
                  const CalibrateExtrinsicsArguments& arguments) {
  const double moved_mm = 1000 * v.moved_m;
  const double moved_deg = v.moved_rad / kDegree;
  terminal.out << fmt::format(
      "  cam{}, X_BV (camera in IMU axes), moved by {:.2f} mm and {:.3f}°\n", k, moved_mm,
      moved_deg);
  Eigen::Matrix<double, 6, 1> place;
  place << v.X_BV.p, log_so3(v.X_BV.q);
  for (std::size_t i = 0; i < v.axes.size(); ++i) {
    const double scale = i < 3 ? 1000 : 1 / kDegree;
    terminal.out << fmt::format("    {}  {:.3f} ± {:.3f} {}", kAxes[i],
                                scale * place(static_cast<Eigen::Index>(i)),
                                scale * v.axes[i].sigma, i < 3 ? "mm" : "°");
    if (!v.axes[i].observed) terminal.out << "   weak: " << motion_for_axis(i);
    terminal.out << "\n";
  }
  if (moved_mm > kSurprising_sigma * arguments.prior_mm ||
      moved_deg > kSurprising_sigma * arguments.prior_deg)
    terminal.out << "    this is further from the recording's own X_BV than --prior-mm and "
                    "--prior-deg allow: widen them and run again\n";
}

void print_report(const Terminal& terminal, const CameraImuCalibration& c,
                  const CalibrateExtrinsicsArguments& arguments, const std::string& file) {
  const auto& s = c.statistics;
  terminal.out << fmt::format("{}: {:.1f} s, {} images, {} sightings used, {} rejected\n",
                              arguments.recording, s.data_s, s.frames, s.tags_used,
                              s.tags_rejected);
  for (std::size_t k = 0; k < c.verdicts.size(); ++k)
    print_camera(terminal, k, c.verdicts[k], arguments);
  if (!arguments.keep_time) {
    terminal.out << fmt::format(
        "  time: images are {:.3f} ± {:.3f} ms later than their stamps (added to "
        "timeshift_cam_imu)\n",
        1000 * c.time.shift_s, 1000 * c.time.sigma_s);
    if (!time_is_good(c))
      terminal.out << "    weak: "
                   << (c.time.determined ? "more than 1 ms uncertain"
                                         : "the motion is too gentle to show it")
                   << "; turn quickly to and fro\n";
  }
  if (c.begins_in_motion)
    terminal.out << "  weak: no moment was found in which it was held still with tags in view, and "
                    "it may be centimetres off; hold it still for two seconds, then wave\n";
  terminal.out << fmt::format(
      "  reprojection median {:.2f} px, 95 % {:.2f} px; NIS per degree of freedom {:.2f}\n"
      "verdict: {}\nwritten: {} (bodies: cameras: calibration)\n",
      s.reprojection_median_px, s.reprojection_p95_px, s.nis_per_dof(),
      is_good(c, !arguments.keep_time) ? "good" : "weak, see above: better record again", file);
}

}  // namespace

int run_calibrate_extrinsics(const CalibrateExtrinsicsArguments& arguments,
                             const Terminal& terminal) {
  const auto result = calibrate(arguments, terminal);
  if (!result) return report(terminal, result.error());
  if (result->time.at_border)
    return report(terminal, {ErrorCode::kInvalid,
                             "the camera's stamps are more than 50 ms off the IMU's; put a rough "
                             "timeshift_cam_imu into cam0/sensor.yaml and run again",
                             arguments.recording});
  const std::string file = (std::filesystem::path(arguments.out) / "camchain-imucam.yaml").string();
  constexpr const char* kHeading = "Camera-IMU calibration by fiducap calibrate extrinsics";
  keep_before(file, terminal);
  if (auto written = write_whole_file(file, to_kalibr_camchain(result->cameras, kHeading));
      !written)
    return report(terminal, written.error());
  if (arguments.json) return print_json(terminal, json_report(*result, !arguments.keep_time));
  print_report(terminal, *result, arguments, file);
  return kExitOk;
}

void add_calibrate_extrinsics(CLI::App& calibrate, ChosenVerb& chosen) {
  auto* verb = calibrate.add_subcommand("extrinsics",
                                        "Where the camera sits on the IMU, and how far their "
                                        "clocks are apart, from a waving recording");
  auto& a = arguments_of<CalibrateExtrinsicsArguments>(*verb, chosen, run_calibrate_extrinsics);
  verb->add_option("RECORDING", a.recording,
                   "Folder in the EuRoC/ASL layout with camera, IMU and tags")
      ->required();
  verb->add_option("--out", a.out, "Folder for camchain-imucam.yaml")->capture_default_str();
  add_positive(*verb, "--prior-mm", a.prior_mm,
               "How far the recording's T_BS may be off, per axis");
  add_positive(*verb, "--prior-deg", a.prior_deg, "The same for its rotation");
  verb->add_flag("--keep-time", a.keep_time, "Do not search the time offset");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Record: rest for 2 s, then wave the robot for 60 s in front of three or more tags, near "
      "enough to fill the image:\n"
      "turn to and fro about all three axes, quickly but without blur, and move it to all sides. "
      "Tags always in view.\n"
      "cam0/sensor.yaml needs intrinsics and a rough T_BS; imu0/sensor.yaml the IMU's noise "
      "(fiducap calibrate imu).\n"
      "Then: bodies: cameras: calibration: calibration/camchain-imucam.yaml\n"
      "Example:\n  fiducap calibrate extrinsics recordings/waving --out calibration");
}

}  // namespace fiducap
