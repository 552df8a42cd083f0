#include "streaming/vrpn/vrpn_config.hpp"

#include <arpa/inet.h>

#include <sstream>

namespace fiducap::vrpn {

namespace {

bool is_ipv4(const std::string& text) {
  in_addr parsed{};
  return ::inet_pton(AF_INET, text.c_str(), &parsed) == 1;
}

bool is_box(const std::array<double, 6>& box) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (!std::isfinite(box[i]) || !std::isfinite(box[i + 3]) || box[i] >= box[i + 3]) return false;
  }
  return true;
}

bool is_pose(const Pose& X) {
  return X.p.allFinite() && X.q.coeffs().allFinite() && std::abs(X.q.norm() - 1.0) < 1e-3;
}

std::string text_of(const std::array<double, 6>& box) {
  std::ostringstream text;
  for (std::size_t i = 0; i < box.size(); ++i) text << (i == 0 ? "[" : ", ") << box[i];
  return text.str() + "]";
}

}  // namespace

std::vector<Pose> VrpnConfig::sensors_of(std::string_view body) const {
  std::vector<Pose> all;
  for (const ExtraSensor& sensor : sensors) {
    if (sensor.body == body) all.push_back({sensor.X_PS.q.normalized(), sensor.X_PS.p});
  }
  return all;
}

std::vector<ConfigError> VrpnConfig::check() const {
  auto errors = Checker{"streaming.vrpn."}
                    .require(is_ipv4(address), "address", address,
                             "must be an IPv4 address, e.g. 127.0.0.1 or 0.0.0.0 for all")
                    .within("max_clients", max_clients, 1, 256)
                    .within("minor_version", minor_version, 0, 99)
                    .require(is_box(workspace_box_m), "workspace_box_m", text_of(workspace_box_m),
                             "must be min x y z, max x y z, finite, each min below its max")
                    .errors;
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    const auto of_body = static_cast<int>(sensors_of(sensors[i].body).size());
    const auto broken =
        Checker{"streaming.vrpn.sensors." + std::to_string(i) + "."}
            .require(!sensors[i].body.empty() && of_body < kMaxSensors, "body",
                     '"' + sensors[i].body + '"', "must name a body, at most four times")
            .require(is_pose(sensors[i].X_PS), "X_PS", "{…}",
                     "must be finite, with a unit quaternion")
            .errors;
    errors.insert(errors.end(), broken.begin(), broken.end());
  }
  return errors;
}

ServedProtocol VrpnConfig::served() const {
  return {"vrpn",  enabled,
          address, {{port, false}, {port, true}},
          axes(),  conventions_of("vrpn").when_invalid};
}

}  // namespace fiducap::vrpn
