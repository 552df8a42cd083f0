#include <array>
#include <filesystem>
#include <locale>
#include <sstream>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/whole_file.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/recording/recording_source.hpp"
#include "pipeline/imu_plausibility.hpp"
#include "tools/calibrate/calibrate.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

constexpr std::array<const char*, kImuAxes> kNames{"gyro x",  "gyro y",  "gyro z",
                                                   "accel x", "accel y", "accel z"};

/// Only imu0/data.csv is needed: no camera, no calibration.
Expected<std::vector<ImuSample>> read_imu(const std::string& folder, const Terminal& terminal) {
  const auto layout = RecordingLayout::find(folder);
  if (!layout) return tl::unexpected(layout.error());
  auto stream = ImuStream::open(*layout, RecordingInfo{});
  if (!stream) return tl::unexpected(stream.error());
  std::vector<ImuSample> samples;
  ImuPlausibility plausibility;
  ProgressLine line(terminal);
  while (const auto sample = stream->next()) {
    samples.push_back(std::get<ImuSample>(*sample));
    plausibility.add(samples.back());
    if (samples.size() % 10000 == 0)
      line.show("reading " + folder + ": " + std::to_string(samples.size()) + " samples");
  }
  stream->log_damage();
  for (const auto& fault : plausibility.faults(false))
    if (fault && is_fatal(*fault))
      return fail(ErrorCode::kInvalid, std::string(text_of(*fault)), layout->imu_csv().string());
  return samples;
}

PlotPanel panel_of(const StaticImuNoise& result, std::size_t first, const std::string& label) {
  PlotPanel panel{label};
  panel.logarithmic = true;
  for (std::size_t axis = first; axis < first + 3; ++axis) {
    const char* color = kPlotColors[axis - first];
    PlotLine measured{kNames[axis], color, {}, false, 2};
    PlotLine fitted{std::string(kNames[axis]) + ": fit", color, {}, true, 1.3};
    for (const AllanPoint& p : result.plot[axis]) {
      measured.points.emplace_back(p.tau_s, p.deviation);
      fitted.points.emplace_back(p.tau_s, result.axes[axis].deviation(p.tau_s));
    }
    panel.lines.push_back(std::move(measured));
    panel.lines.push_back(std::move(fitted));
  }
  return panel;
}

/// The two asymptotes: slope −1/2 through (1 s, N), slope +1/2 through (3 s, K).
void add_lines(PlotPanel& panel, const std::vector<AllanPoint>& plot, double white, double walk,
               bool walk_seen) {
  PlotLine down{"slope −1/2, read at 1 s", kPlotGray, {}, true, 1.3};
  PlotLine up{walk_seen ? "slope +1/2, read at 3 s" : "slope +1/2, upper bound",
              kPlotColors[4],
              {},
              true,
              1.3};
  for (const AllanPoint& p : plot) {
    down.points.emplace_back(p.tau_s, white / std::sqrt(p.tau_s));
    const double rise = walk * std::sqrt(p.tau_s / 3);
    if (rise > plot.back().deviation / 10) up.points.emplace_back(p.tau_s, rise);
  }
  panel.lines.push_back(std::move(down));
  panel.lines.push_back(std::move(up));
}

PlotPage allan_plots(const StaticImuNoise& result) {
  LinePlot plot{"Allan deviation of the IMU at rest", "averaging time τ, s"};
  plot.logarithmic = true;
  plot.panel_height = 300;
  plot.panels = {panel_of(result, 0, "gyroscope, rad/s"),
                 panel_of(result, 3, "accelerometer, m/s²")};
  add_lines(plot.panels[0], result.plot[0], result.noise.gyro_noise_rad_s_rtHz,
            result.noise.gyro_walk_rad_s2_rtHz, result.gyro_walk_seen);
  add_lines(plot.panels[1], result.plot[3], result.noise.accel_noise_m_s2_rtHz,
            result.noise.accel_walk_m_s3_rtHz, result.accel_walk_seen);
  PlotPage page;
  page.title = "IMU noise";
  page.plots = {std::move(plot)};
  return page;
}

nlohmann::ordered_json json_report(const StaticImuNoise& r) {
  nlohmann::ordered_json axes = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < kImuAxes; ++i) {
    const AxisNoise& a = r.axes[i];
    axes.push_back({{"axis", kNames[i]},
                    {"noise_density", a.white},
                    {"noise_density_sigma", a.white_sigma},
                    {"flicker", a.flicker},
                    {"random_walk", a.walk},
                    {"random_walk_sigma", a.walk_sigma},
                    {"random_walk_seen", a.walk_seen},
                    {"random_walk_bound", a.walk_bound}});
  }
  return {{"seconds", r.seconds},
          {"rate_hz", r.rate_hz},
          {"samples", r.samples},
          {"lost", r.lost},
          {"axes", axes},
          {"gyroscope_noise_density", r.noise.gyro_noise_rad_s_rtHz},
          {"gyroscope_random_walk", r.noise.gyro_walk_rad_s2_rtHz},
          {"gyroscope_random_walk_is_bound", !r.gyro_walk_seen},
          {"accelerometer_noise_density", r.noise.accel_noise_m_s2_rtHz},
          {"accelerometer_random_walk", r.noise.accel_walk_m_s3_rtHz},
          {"accelerometer_random_walk_is_bound", !r.accel_walk_seen}};
}

std::string too_short(const char* sensor, const AxisNoise& axis, const StaticImuNoise& r) {
  const double needed = std::max(axis.seconds_to_see(axis.walk_bound), 2 * r.seconds);
  return fmt::format(
      "  {}: no bias walk to be seen in {:.1f} min, the file has its upper bound (safe, a little "
      "pessimistic). To measure it record {:.0f} min or more.\n",
      sensor, r.seconds / 60, needed / 60);
}

void print_table(const StaticImuNoise& r, const std::string& folder, const Terminal& terminal) {
  terminal.out << fmt::format(
      "{:.1f} min at {:.2f} Hz, {} samples lost\n"
      "           white noise (unit/√Hz)    bias walk (unit/s/√Hz)     unit: rad/s, m/s²\n",
      r.seconds / 60, r.rate_hz, r.lost);
  for (std::size_t i = 0; i < kImuAxes; ++i) {
    const AxisNoise& a = r.axes[i];
    terminal.out << fmt::format("  {}{}  {:.3e} ± {:.3e}   ", kNames[i], i < 3 ? " " : "", a.white,
                                a.white_sigma)
                 << (a.walk_seen ? fmt::format("{:.3e} ± {:.3e}", a.walk, a.walk_sigma)
                                 : fmt::format("not seen, < {:.3e}", a.walk_bound))
                 << "\n";
  }
  if (!r.gyro_walk_seen) terminal.out << too_short("gyro", r.axes[0], r);
  if (!r.accel_walk_seen) terminal.out << too_short("accelerometer", r.axes[3], r);
  const std::filesystem::path to(folder);
  terminal.out << "written: " << (to / "imu.yaml").string() << " (bodies: kalibr_imu), "
               << (to / "allan.html").string() << "\n";
}

nlohmann::ordered_json rows_json(const Eigen::Matrix3d& M) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({M(i, 0), M(i, 1), M(i, 2)});
  return rows;
}

nlohmann::ordered_json list_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

nlohmann::ordered_json poses_json(const MultiPoseImu& r) {
  const ImuCorrection& c = r.correction;
  return {{"seconds", r.seconds},
          {"rests", r.rests},
          {"turns", r.turns},
          {"accel_bias_m_s2", list_json(c.accel_bias_m_s2)},
          {"accel_bias_sigma_m_s2", list_json(r.accel_bias_sigma_m_s2)},
          {"accel_matrix", rows_json(c.accel_matrix)},
          {"accel_scale_sigma", list_json(r.accel_scale_sigma)},
          {"gyro_bias_rad_s", list_json(c.gyro_bias_rad_s)},
          {"gyro_matrix", rows_json(c.gyro_matrix)},
          {"gyro_scale_sigma", list_json(r.gyro_scale_sigma)},
          {"gravity_rms_m_s2", {{"before", r.gravity_rms_before}, {"after", r.gravity_rms_after}}},
          {"up_rms_rad", {{"before", r.up_rms_before}, {"after", r.up_rms_after}}}};
}

std::string listed(const Eigen::Vector3d& v, int decimals) {
  return fmt::format("{:.{}f}  {:.{}f}  {:.{}f}", v.x(), decimals, v.y(), decimals, v.z(),
                     decimals);
}

/// Deviations of the diagonal from 1, in percent.
std::string percent_list(const Eigen::Matrix3d& M, const Eigen::Vector3d& sigma) {
  std::string text;
  for (int i = 0; i < 3; ++i)
    text +=
        fmt::format("{}{:.3f} ± {:.3f}", i == 0 ? "" : "  ", 100 * (M(i, i) - 1), 100 * sigma(i));
  return text;
}

void print_poses(const MultiPoseImu& r, const std::string& file, const Terminal& terminal) {
  const ImuCorrection& c = r.correction;
  terminal.out << fmt::format("{} attitudes at rest, {} turns between them, in {:.1f} min\n",
                              r.rests, r.turns, r.seconds / 60)
               << "  accelerometer bias, m/s²: " << listed(c.accel_bias_m_s2, 4) << "\n"
               << "  accelerometer scale, % off: "
               << percent_list(c.accel_matrix, r.accel_scale_sigma) << "\n"
               << "  gyro bias, rad/s: " << listed(c.gyro_bias_rad_s, 5) << "\n"
               << "  gyro scale, % off: " << percent_list(c.gyro_matrix, r.gyro_scale_sigma) << "\n"
               << fmt::format(
                      "  |f| against gravity: {:.4f} m/s² RMS as read, {:.4f} corrected\n"
                      "  up carried by the gyro: {:.2f}° RMS as read, {:.2f}° corrected\n"
                      "written: {}\n",
                      r.gravity_rms_before, r.gravity_rms_after,
                      r.up_rms_before * kDegreesPerRadian, r.up_rms_after * kDegreesPerRadian,
                      file);
}

int run_poses(const CalibrateImuArguments& arguments, const std::vector<ImuSample>& samples,
              const Terminal& terminal) {
  const auto result = calibrate_multi_pose(samples, arguments.gravity_m_s2, arguments.recording);
  if (!result) return report(terminal, result.error());
  const std::string file = (std::filesystem::path(arguments.out) / "imu_correction.yaml").string();
  const std::string heading = "IMU correction by fiducap calibrate imu --poses, from " +
                              std::to_string(result->rests) + " attitudes at rest";
  keep_before(file, terminal);
  if (auto written = write_whole_file(file, to_imu_correction_yaml(result->correction, heading));
      !written)
    return report(terminal, written.error());
  if (arguments.json) return print_json(terminal, poses_json(*result));
  print_poses(*result, file, terminal);
  return kExitOk;
}

/// Kalibr's imu.yaml, as read_imu_noise reads it; comments mark values that are upper bounds.
std::string to_kalibr_imu(const StaticImuNoise& result, const std::string& heading) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(6);
  const char* bound = "  # upper bound (95 %): the recording shows no walk";
  const ImuNoise& n = result.noise;
  out << "# " << heading << "\n"
      << "accelerometer_noise_density: " << n.accel_noise_m_s2_rtHz << "  # m/s^2/sqrt(Hz)\n"
      << "accelerometer_random_walk: " << n.accel_walk_m_s3_rtHz
      << (result.accel_walk_seen ? "  # m/s^3/sqrt(Hz)" : bound) << "\n"
      << "gyroscope_noise_density: " << n.gyro_noise_rad_s_rtHz << "  # rad/s/sqrt(Hz)\n"
      << "gyroscope_random_walk: " << n.gyro_walk_rad_s2_rtHz
      << (result.gyro_walk_seen ? "  # rad/s^2/sqrt(Hz)" : bound) << "\n"
      << "rostopic: /imu0\nupdate_rate: " << n.rate_hz << "\n";
  return out.str();
}

}  // namespace

int run_calibrate_imu(const CalibrateImuArguments& arguments, const Terminal& terminal) {
  const auto samples = read_imu(arguments.recording, terminal);
  if (!samples) return report(terminal, samples.error());
  if (arguments.poses) return run_poses(arguments, *samples, terminal);
  const auto result = identify_static_imu(*samples, arguments.recording);
  if (!result) return report(terminal, result.error());
  const std::filesystem::path to(arguments.out);
  const std::string heading =
      "IMU noise by fiducap calibrate imu, from " + fixed(result->seconds, 0) + " s at rest";
  keep_before((to / "imu.yaml").string(), terminal);
  if (auto written = write_whole_file((to / "imu.yaml").string(), to_kalibr_imu(*result, heading));
      !written)
    return report(terminal, written.error());
  if (auto written = write_whole_file((to / "allan.html").string(), to_html(allan_plots(*result)));
      !written)
    return report(terminal, written.error());
  if (arguments.json) return print_json(terminal, json_report(*result));
  print_table(*result, arguments.out, terminal);
  return kExitOk;
}

void add_calibrate_imu(CLI::App& calibrate, ChosenVerb& chosen) {
  auto* verb = calibrate.add_subcommand(
      "imu",
      "IMU noise from a recording at rest (Allan deviation, white noise, bias walk); with --poses "
      "bias, scale and misalignment from many attitudes");
  auto& a = arguments_of<CalibrateImuArguments>(*verb, chosen, run_calibrate_imu);
  verb->add_option("RECORDING", a.recording,
                   "Folder in the EuRoC/ASL layout; mav0/imu0/data.csv is enough")
      ->required();
  verb->add_option("--out", a.out, "Folder for imu.yaml and allan.html, or imu_correction.yaml")
      ->capture_default_str();
  auto* poses = verb->add_flag("--poses", a.poses,
                               "The IMU was put down in 20 to 40 attitudes, two seconds each, and "
                               "turned by hand between them");
  add_positive(*verb, "--gravity", a.gravity_m_s2, "Where it was recorded, m/s²")->needs(poses);
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Record: let the IMU warm up, put it on a solid table away from fans, and do not touch the "
      "table for 10 minutes\n"
      "at least; an hour shows the bias walk of a good gyro. A recording in which it moved is "
      "refused.\n"
      "Then: bodies: kalibr_imu: calibration/imu.yaml\n"
      "Example:\n  fiducap calibrate imu recordings/still --out calibration");
}

}  // namespace fiducap
