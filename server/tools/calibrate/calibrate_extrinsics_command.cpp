#include "tools/calibrate/calibrate_extrinsics_command.hpp"

#include <array>
#include <filesystem>
#include <numbers>

#include <nlohmann/json.hpp>

#include "base/so3.hpp"
#include "base/whole_file.hpp"
#include "calibration/extrinsics/camera_imu_calibration.hpp"
#include "daemon/system_clock.hpp"
#include "tools/calibrate/kept_file.hpp"
#include "tools/usable_recording.hpp"

namespace fiducap {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kGoodTime_s = 0.001;
constexpr double kSurprising_sigma = 3;
constexpr std::array<const char*, 6> kAxes{"x", "y", "z", "rotation x", "rotation y", "rotation z"};

Error in_recording(Error error, const std::string& recording) {
  if (error.context.empty()) error.context = recording;
  return error;
}

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
  if (!result) return tl::unexpected(in_recording(result.error(), arguments.recording));
  return result;
}

bool time_is_good(const CameraImuCalibration& c) {
  return c.time.determined && !c.time.at_border && c.time.sigma_s < kGoodTime_s;
}

bool is_good(const CameraImuCalibration& c, bool time_searched) {
  if (c.begins_in_motion || (time_searched && !time_is_good(c))) return false;
  for (const CameraVerdict& camera : c.verdicts)
    for (const AxisVerdict& axis : camera.axes)
      if (!axis.observed) return false;
  return true;
}

nlohmann::ordered_json camera_json(const CameraVerdict& verdict, const CameraMount& mount) {
  const Eigen::Vector3d& p = verdict.X_BV.p;
  const Eigen::Quaterniond& q = verdict.X_BV.q;
  nlohmann::ordered_json sigmas = nlohmann::ordered_json::array();
  nlohmann::ordered_json weak = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < verdict.axes.size(); ++i) {
    sigmas.push_back(verdict.axes[i].sigma);
    if (!verdict.axes[i].observed)
      weak.push_back({{"axis", kAxes[i]}, {"motion", motion_that_shows(i)}});
  }
  return {{"position_m", {p.x(), p.y(), p.z()}},
          {"orientation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
          {"sigma_m_rad", sigmas},
          {"not_observed", weak},
          {"moved_m", verdict.moved_m},
          {"moved_rad", verdict.moved_rad},
          {"timeshift_cam_imu_s", to_seconds(mount.time_shift)}};
}

std::string json_report(const CameraImuCalibration& c, bool time_searched) {
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
  return report.dump(2) + "\n";
}

void print_axis(const Terminal& terminal, const char* name, double value, double sigma,
                const AxisVerdict& axis, std::size_t i, const char* unit) {
  terminal.out << "    " << name << "  " << fixed(value, 3) << " ± " << fixed(sigma, 3) << " "
               << unit;
  if (!axis.observed) terminal.out << "   weak: " << motion_that_shows(i);
  terminal.out << "\n";
}

void print_camera(const Terminal& terminal, std::size_t k, const CameraVerdict& v,
                  const CalibrateExtrinsicsArguments& arguments) {
  terminal.out << "  cam" << k << ", X_BV (camera in IMU axes), moved by "
               << fixed(v.moved_m * 1000, 2) << " mm and " << fixed(v.moved_rad / kDegree, 3)
               << "°\n";
  const Eigen::Vector3d rotation = log_so3(v.X_BV.q);
  for (std::size_t i = 0; i < 6; ++i) {
    const auto at = static_cast<Eigen::Index>(i % 3);
    if (i < 3)
      print_axis(terminal, kAxes[i], v.X_BV.p(at) * 1000, v.axes[i].sigma * 1000, v.axes[i], i,
                 "mm");
    else
      print_axis(terminal, kAxes[i], rotation(at) / kDegree, v.axes[i].sigma / kDegree, v.axes[i],
                 i, "°");
  }
  if (v.moved_m * 1000 > kSurprising_sigma * arguments.prior_mm ||
      v.moved_rad / kDegree > kSurprising_sigma * arguments.prior_deg)
    terminal.out << "    this is further from the recording's own X_BV than --prior-mm and "
                    "--prior-deg allow: widen them and run again\n";
}

void print_time(const Terminal& terminal, const CameraImuCalibration& c) {
  terminal.out << "  time: images are " << fixed(c.time.shift_s * 1000, 3) << " ± "
               << fixed(c.time.sigma_s * 1000, 3)
               << " ms later than their stamps say (added to timeshift_cam_imu)\n";
  if (!c.time.determined)
    terminal.out << "    weak: the motion is too gentle to show it; turn quickly to and fro\n";
  else if (!time_is_good(c))
    terminal.out << "    weak: more than 1 ms uncertain; turn quickly to and fro\n";
}

void print_report(const Terminal& terminal, const CameraImuCalibration& c,
                  const CalibrateExtrinsicsArguments& arguments, const std::string& file) {
  terminal.out << arguments.recording << ": " << fixed(c.statistics.data_s, 1) << " s, "
               << c.statistics.frames << " images, " << c.statistics.tags_used
               << " sightings used, " << c.statistics.tags_rejected << " rejected\n";
  for (std::size_t k = 0; k < c.verdicts.size(); ++k)
    print_camera(terminal, k, c.verdicts[k], arguments);
  if (!arguments.keep_time) print_time(terminal, c);
  if (c.begins_in_motion)
    terminal.out << "  weak: no moment was found in which it was held still with tags in view, and "
                    "it may be centimetres off; hold it still for two seconds, then wave\n";
  terminal.out << "  reprojection median " << fixed(c.statistics.reprojection_median_px, 2)
               << " px, 95 % " << fixed(c.statistics.reprojection_p95_px, 2)
               << " px; NIS per degree of freedom " << fixed(c.statistics.nis_per_dof(), 2) << "\n"
               << "verdict: "
               << (is_good(c, !arguments.keep_time) ? "good"
                                                    : "weak, see above: better record again")
               << "\n"
               << "written: " << file << " (bodies: cameras: calibration)\n";
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
  const std::string heading = "Camera-IMU calibration by fiducap calibrate extrinsics";
  keep_before(file, terminal);
  if (auto written = write_whole_file(file, to_kalibr_camchain(result->cameras, heading)); !written)
    return report(terminal, written.error());
  if (arguments.json)
    terminal.out << json_report(*result, !arguments.keep_time);
  else
    print_report(terminal, *result, arguments, file);
  return kExitOk;
}

}  // namespace fiducap
