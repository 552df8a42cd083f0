#include "capture/imu/imu_source_config.hpp"

#include <cmath>

#include <yaml-cpp/yaml.h>
#include <Eigen/Geometry>

#include "base/text.hpp"
#include "capture/imu/byte_link.hpp"
#include "capture/ros/ros_config.hpp"

namespace fiducap {
namespace {

constexpr double kUnit = 1e-3;  // rounding of hand-typed quaternions
constexpr const char* kAxesRule =
    "must be flu, frd, camera, three axes as [x, -y, -z] that are right-handed (x, y and z once "
    "each; an odd number of minus signs or a swap alone would mirror), or a unit quaternion [w, x, "
    "y, z]";

std::optional<Eigen::RowVector3d> row_of(std::string word) {
  double sign = 1;
  if (word.starts_with('-') || word.starts_with('+')) {
    sign = word.front() == '-' ? -1 : 1;
    word.erase(0, 1);
  }
  if (word.size() != 1 || word[0] < 'x' || word[0] > 'z') return std::nullopt;
  Eigen::RowVector3d row = Eigen::RowVector3d::Zero();
  row[word[0] - 'x'] = sign;
  return row;
}

std::optional<Eigen::Matrix3d> by_axes(std::span<const std::string> words) {
  Eigen::Matrix3d R_BS;
  for (int i = 0; i < 3; ++i) {
    const auto row = row_of(words[static_cast<std::size_t>(i)]);
    if (!row) return std::nullopt;
    R_BS.row(i) = *row;
  }
  // −1: mirrored; 0: an axis twice.
  return R_BS.determinant() == 1 ? std::optional(R_BS) : std::nullopt;
}

std::optional<Eigen::Matrix3d> by_quaternion(std::span<const std::string> words) {
  std::array<double, 4> q{};
  for (std::size_t i = 0; i < 4; ++i) {
    if (!parse_number(words[i], q[i]) || !std::isfinite(q[i])) return std::nullopt;
  }
  const Eigen::Quaterniond q_BS(q[0], q[1], q[2], q[3]);
  if (std::abs(q_BS.norm() - 1) > kUnit) return std::nullopt;
  return q_BS.normalized().toRotationMatrix();
}

}  // namespace

std::optional<ImuAxes> axes_from(std::span<const std::string> words) {
  using Known = std::pair<std::string_view, std::array<std::string, 3>>;
  static const std::array<Known, 3> kKnown{
      {{"flu", {"x", "y", "z"}}, {"frd", {"x", "-y", "-z"}}, {"camera", {"z", "-x", "-y"}}}};
  std::optional<Eigen::Matrix3d> R_BS;
  for (const auto& [word, axes] : kKnown)
    if (words.size() == 1 && words[0] == word) return ImuAxes{*by_axes(axes), words[0]};
  if (words.size() == 3) R_BS = by_axes(words);
  if (words.size() == 4) R_BS = by_quaternion(words);
  return R_BS ? std::optional(ImuAxes{*R_BS, "[" + comma_list(words) + "]"}) : std::nullopt;
}

std::optional<std::string> read_value(const YAML::Node& node, ImuAxes& out) {
  std::vector<std::string> words;
  if (node.IsScalar()) words.push_back(node.Scalar());
  if (node.IsSequence() && node.size() <= 4) {
    for (const auto& item : node) words.push_back(item.IsScalar() ? item.Scalar() : "");
  }
  const auto axes = axes_from(words);
  if (!axes) return kAxesRule;
  out = *axes;
  return std::nullopt;
}

std::string text_of(const ImuAxes& axes) { return axes.written; }

void LinkConfig::check(Checker& checker) const {
  const bool by_udp = device.empty();
  const auto other = parse_link_peer(peer);
  const auto own = parse_link_peer(address);
  const bool speaks_first = other && other->port > 0;
  checker
      .require(device.empty() || device.starts_with('/'), "device", '"' + device + '"',
               "must be the path of a serial device, e.g. /dev/ttyACM0")
      .within("baud", baud, 50, 12'000'000)
      .require(by_udp || (port == 0 && peer.empty()), "port", port,
               "must not be given together with device: it is a serial line or UDP")
      .require(!by_udp || port > 0 || speaks_first, "port", port,
               "must be the UDP port where the readings come in (or give device, a serial line)")
      .require(own && own->port == 0, "address", '"' + address + '"',
               "must be an IPv4 address of this machine, or 0.0.0.0 for all")
      .require(peer.empty() || other, "peer", '"' + peer + '"',
               "must be an IPv4 address, e.g. 192.168.1.20 or 192.168.1.20:14580");
}

void MavlinkImuConfig::check(Checker& checker) const {
  constexpr double kBytes = 80;  // HIGHRES_IMU with its frame, and some other messages
  constexpr double kBits = 10;   // 8N1
  const double needed = rate_hz * kBytes * kBits;
  link.check(checker);
  checker.within("system", system, 0, 255).within("rate_hz", rate_hz, 0, 2000);
  // USB devices are not limited by the baud rate.
  const bool is_usb = link.device.find("ACM") != std::string::npos ||
                      link.device.find("/usb-") != std::string::npos;
  checker.require(link.device.empty() || is_usb || needed <= link.baud, "rate_hz", rate_hz,
                  "needs " + std::to_string(static_cast<int>(needed)) +
                      " baud, the serial line has " + std::to_string(link.baud) +
                      ": request less, or set a higher baud rate on both sides");
}

void IioConfig::check(Checker& checker) const {
  const bool known = uri == "local:" || uri.starts_with("ip:") || uri.starts_with("usb:");
  checker
      .require(known, "uri", '"' + uri + '"',
               "must be local: (this machine), ip:ADDRESS (where iiod runs) or usb:")
      .within("rate_hz", rate_hz, 0, 10'000)
      .within("samples", samples, 1, 1024);
}

void ImuTopicConfig::check(Checker& checker) const {
  checker
      .require(dds::is_topic_name(topic), "topic", '"' + topic + '"',
               "must be a topic, e.g. /imu/data")
      .require(accel.empty() || dds::is_topic_name(accel), "accel", '"' + accel + '"',
               "must be a topic, e.g. /camera/accel/sample, or empty");
}

std::vector<ConfigError> ImuSourceConfig::check(const std::string& prefix) const {
  Checker checker{prefix};
  visit_imu_source(*this, [&](const auto& chosen) { chosen.check(checker); });
  checker.require(px4.accel.empty(), "accel", '"' + px4.accel + '"',
                  "must be empty: PX4's topic has both sensors");
  const bool is_frd = type == ImuSourceType::kMavlink || type == ImuSourceType::kPx4;
  checker.require(
      !is_frd || axes.written != "frd", "axes", axes.written,
      "must not be frd here: readings of MAVLink and PX4 are converted to flu already. An "
      "autopilot that is mounted upside down has [x, -y, -z]");
  return checker.errors;
}

}  // namespace fiducap
