#include "tools/calibrate/calibrate_imu_command.hpp"

#include <array>
#include <cstdio>
#include <filesystem>
#include <locale>
#include <sstream>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "calibration/imu/multi_pose_imu.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/recording/recording_streams.hpp"
#include "pipeline/imu_plausibility.hpp"
#include "tools/calibrate/kept_file.hpp"
#include "tools/plot/line_plot.hpp"

namespace fiducap {
namespace {

constexpr std::array<const char*, kImuAxes> kNames{"gyro x",  "gyro y",  "gyro z",
                                                   "accel x", "accel y", "accel z"};

std::string scientific(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3e", value);
  return text.data();
}

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
  if (const auto fault = plausibility.take_news(); fault && is_fatal(*fault))
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

/// The two straight lines that are read: slope −1/2 through (1 s, N), slope +1/2 through (3 s, K).
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

std::string allan_svg(const StaticImuNoise& result) {
  LinePlot plot{"Allan deviation of the IMU at rest", "averaging time τ, s"};
  plot.logarithmic = true;
  plot.panel_height = 300;
  plot.panels = {panel_of(result, 0, "gyroscope, rad/s"),
                 panel_of(result, 3, "accelerometer, m/s²")};
  add_lines(plot.panels[0], result.plot[0], result.noise.gyro_noise_rad_s_rtHz,
            result.noise.gyro_walk_rad_s2_rtHz, result.gyro_walk_seen);
  add_lines(plot.panels[1], result.plot[3], result.noise.accel_noise_m_s2_rtHz,
            result.noise.accel_walk_m_s3_rtHz, result.accel_walk_seen);
  return to_svg(plot);
}

std::string json_report(const StaticImuNoise& r) {
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
  const nlohmann::ordered_json report{
      {"seconds", r.seconds},
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
  return report.dump(2) + "\n";
}

std::string too_short(const char* sensor, const AxisNoise& axis, const StaticImuNoise& r) {
  const double needed = std::max(axis.seconds_to_see(axis.walk_bound), 2 * r.seconds);
  return std::string("  ") + sensor + ": no bias walk to be seen in " + fixed(r.seconds / 60, 1) +
         " min, the file has its upper bound (safe, a little pessimistic). To measure it record " +
         fixed(needed / 60, 0) + " min or more.\n";
}

void print_table(const StaticImuNoise& r, const std::string& folder, const Terminal& terminal) {
  terminal.out
      << fixed(r.seconds / 60, 1) << " min at " << fixed(r.rate_hz, 2) << " Hz, " << r.lost
      << " samples lost\n"
      << "           white noise (unit/√Hz)    bias walk (unit/s/√Hz)     unit: rad/s, m/s²\n";
  for (std::size_t i = 0; i < kImuAxes; ++i) {
    const AxisNoise& a = r.axes[i];
    terminal.out << "  " << kNames[i] << (i < 3 ? " " : "") << "  " << scientific(a.white) << " ± "
                 << scientific(a.white_sigma) << "   "
                 << (a.walk_seen ? scientific(a.walk) + " ± " + scientific(a.walk_sigma)
                                 : "not seen, < " + scientific(a.walk_bound))
                 << "\n";
  }
  if (!r.gyro_walk_seen) terminal.out << too_short("gyro", r.axes[0], r);
  if (!r.accel_walk_seen) terminal.out << too_short("accelerometer", r.axes[3], r);
  const std::filesystem::path to(folder);
  terminal.out << "written: " << (to / "imu.yaml").string() << " (bodies: kalibr_imu), "
               << (to / "allan.svg").string() << "\n";
}

std::string percent_list(const Eigen::Matrix3d& M, const Eigen::Vector3d& sigma) {
  std::string text;
  for (int i = 0; i < 3; ++i)
    text += (i == 0 ? "" : "  ") + fixed(100 * (M(i, i) - 1), 3) + " ± " + fixed(100 * sigma(i), 3);
  return text;
}

nlohmann::ordered_json rows_json(const Eigen::Matrix3d& M) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({M(i, 0), M(i, 1), M(i, 2)});
  return rows;
}

nlohmann::ordered_json list_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

std::string poses_json(const MultiPoseImu& r) {
  const ImuCorrection& c = r.correction;
  const nlohmann::ordered_json report{
      {"seconds", r.seconds},
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
  return report.dump(2) + "\n";
}

void print_poses(const MultiPoseImu& r, const std::string& file, const Terminal& terminal) {
  constexpr double kDegrees = 180 / 3.14159265358979;
  const ImuCorrection& c = r.correction;
  const auto listed = [](const Eigen::Vector3d& v, int decimals) {
    return fixed(v.x(), decimals) + "  " + fixed(v.y(), decimals) + "  " + fixed(v.z(), decimals);
  };
  terminal.out << r.rests << " attitudes at rest, " << r.turns << " turns between them, in "
               << fixed(r.seconds / 60, 1) << " min\n"
               << "  accelerometer bias, m/s²: " << listed(c.accel_bias_m_s2, 4) << "\n"
               << "  accelerometer scale, % off: "
               << percent_list(c.accel_matrix, r.accel_scale_sigma) << "\n"
               << "  gyro bias, rad/s: " << listed(c.gyro_bias_rad_s, 5) << "\n"
               << "  gyro scale, % off: " << percent_list(c.gyro_matrix, r.gyro_scale_sigma) << "\n"
               << "  |f| against gravity: " << fixed(r.gravity_rms_before, 4)
               << " m/s² RMS as read, " << fixed(r.gravity_rms_after, 4) << " corrected\n"
               << "  up carried by the gyro: " << fixed(r.up_rms_before * kDegrees, 2)
               << "° RMS as read, " << fixed(r.up_rms_after * kDegrees, 2) << "° corrected\n"
               << "written: " << file << "\n";
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
  if (arguments.json)
    terminal.out << poses_json(*result);
  else
    print_poses(*result, file, terminal);
  return kExitOk;
}

}  // namespace

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
  if (auto written = write_whole_file((to / "allan.svg").string(), allan_svg(*result)); !written)
    return report(terminal, written.error());
  if (arguments.json)
    terminal.out << json_report(*result);
  else
    print_table(*result, arguments.out, terminal);
  return kExitOk;
}

}  // namespace fiducap
