#include "tools/live/watch_view.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "tools/terminal.hpp"

namespace fiducap {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr std::size_t kAngleWidth = 8;
constexpr std::size_t kRateWidth = 7;

const char* name_of(Tracking tracking) {
  switch (tracking) {
    case Tracking::kSearching:
      return "searching";
    case Tracking::kTracking:
      return "tracking";
    case Tracking::kCoasting:
      return "coasting";
    case Tracking::kLost:
      return "lost";
  }
  return "lost";
}

double length(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }

/// Heading, then pitch, then roll (z-y'-x''), degrees.
std::array<double, 3> yaw_pitch_roll_deg(const std::array<double, 4>& wxyz) {
  const Eigen::Matrix3d R =
      Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).toRotationMatrix();
  return {kDegrees * std::atan2(R(1, 0), R(0, 0)),
          kDegrees * std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0))),
          kDegrees * std::atan2(R(2, 1), R(2, 2))};
}

std::string milliseconds(double seconds) {
  return std::isfinite(seconds) ? fixed(1000 * seconds, 2) + " ms" : "unknown";
}

std::string right(const std::string& text, std::size_t width) {
  return text.size() >= width ? text : std::string(width - text.size(), ' ') + text;
}

std::string column_names() {
  std::string text = "body             state    ";
  for (const char* name : {"x [m]", "y [m]", "z [m]"}) text += ' ' + right(name, 8);
  for (const char* name : {"yaw[deg]", "pitch", "roll"}) text += ' ' + right(name, kAngleWidth);
  for (const char* name : {"[m/s]", "[deg/s]"}) text += ' ' + right(name, kRateWidth);
  for (const char* name : {"1s [mm]", "1s[deg]", "age[ms]"}) text += ' ' + right(name, 7);
  return text + " tags\n";
}

std::string row(const Body& body) {
  std::array<char, 96> head{};
  std::snprintf(head.data(), head.size(), "%-16.32s %-9s", body.name.c_str(),
                name_of(body.tracking));
  std::string text = head.data();
  // A pose that may not be used is not shown: a number on the screen is always one to rely on.
  const auto add = [&](double value, int decimals, std::size_t width) {
    text += ' ' + right(body.valid && std::isfinite(value) ? fixed(value, decimals) : "-", width);
  };
  for (const double p : body.position_m) add(p, 3, 8);
  for (const double angle : yaw_pitch_roll_deg(body.orientation_wxyz)) add(angle, 1, kAngleWidth);
  add(length(body.velocity_m_s), 2, kRateWidth);
  add(kDegrees * length(body.body_rate_rad_s), 0, kRateWidth);
  add(1000 * body.position_sigma_m, 1, 7);
  add(kDegrees * body.rotation_sigma_rad, 2, 7);
  text += ' ' + right(std::isfinite(body.age_s) ? fixed(1000 * body.age_s, 0) : "-", 7) + ' ' +
          right(std::to_string(body.tags_in_view), 4);
  return text + '\n';
}

std::string summary(const Frame& frame, const ClientStatistics& s) {
  return "frame " + std::to_string(frame.number) + "  " + fixed(s.rate_hz, 1) +
         " Hz  latency p50 " + milliseconds(s.latency_p50_s) + " p99 " +
         milliseconds(s.latency_p99_s) + "  lost " + std::to_string(s.lost) + "  map v" +
         std::to_string(frame.map_version);
}

}  // namespace

std::string watch_table(const std::string& server, const Frame& frame,
                        const ClientStatistics& statistics) {
  std::string text = server + (statistics.connected ? "  " : "  NOT ANSWERING  ") +
                     summary(frame, statistics) + "\n";
  text += column_names();
  for (const Body& body : frame.bodies) text += row(body);
  if (frame.bodies.empty()) text += "(the server has no bodies)\n";
  return text;
}

std::string watch_lines(const Frame& frame, const ClientStatistics& statistics) {
  std::string text = summary(frame, statistics) + "\n";
  for (const Body& body : frame.bodies) text += "  " + row(body);
  return text;
}

std::string watch_json(const Frame& frame, const ClientStatistics& statistics) {
  // nlohmann writes NaN as null.
  nlohmann::ordered_json json{{"frame", frame.number},
                              {"at_server_ns", frame.at_server_ns},
                              {"at_utc_ns", frame.at_utc_ns},
                              {"map_version", frame.map_version},
                              {"server_rate_hz", frame.rate_hz},
                              {"received_rate_hz", statistics.rate_hz},
                              {"lost", statistics.lost},
                              {"latency_p50_s", statistics.latency_p50_s},
                              {"latency_p99_s", statistics.latency_p99_s},
                              {"bodies", nlohmann::ordered_json::array()}};
  for (const Body& body : frame.bodies)
    json["bodies"].push_back({{"id", body.id},
                              {"name", body.name},
                              {"tracking", name_of(body.tracking)},
                              {"valid", body.valid},
                              {"position_m", body.position_m},
                              {"orientation_wxyz", body.orientation_wxyz},
                              {"velocity_m_s", body.velocity_m_s},
                              {"body_rate_rad_s", body.body_rate_rad_s},
                              {"acceleration_m_s2", body.acceleration_m_s2},
                              {"position_sigma_m", body.position_sigma_m},
                              {"rotation_sigma_rad", body.rotation_sigma_rad},
                              {"age_s", body.age_s},
                              {"tags_in_view", body.tags_in_view}});
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace fiducap
