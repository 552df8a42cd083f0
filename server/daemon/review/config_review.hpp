#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "daemon/config/config_file.hpp"

namespace fiducap {

/// Checks of a configuration beyond the rules of load_config, without starting it.
struct ConfigReview {
  std::vector<ConfigFault> faults;  ///< It would not run, or never track.
  std::vector<ConfigFault> doubts;  ///< It runs, but probably not as intended.
  std::vector<std::string> plan;    ///< What will run, a line each.

  void fault(std::string path, std::string value, std::string rule) {
    faults.push_back({{std::move(path), std::move(value), std::move(rule)}, ""});
  }
  void doubt(std::string path, std::string value, std::string rule) {
    doubts.push_back({{std::move(path), std::move(value), std::move(rule)}, ""});
  }
};

/// Opens all files, devices and ports of the configuration, and closes them again. Writes nothing.
[[nodiscard]] ConfigReview review(const ServerConfig& config);

/// {"usable", "wrong": [{path, value, rule, where}], "doubtful": […], "will_run": […]}
[[nodiscard]] std::string review_json(const ConfigReview& review);

/// The parts of it.
void review_sensors(const ServerConfig& config, ConfigReview& review);
void review_room(const ServerConfig& config, ConfigReview& review);
void review_service(const ServerConfig& config, ConfigReview& review);

}  // namespace fiducap
