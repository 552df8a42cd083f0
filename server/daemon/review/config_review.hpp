#pragma once

#include <string>
#include <vector>

#include "base/config_check.hpp"
#include "daemon/config/config_file.hpp"

namespace fiducap {

/// What can be known about a configuration without starting it. The rules of single values were
/// checked by load_config.
struct ConfigReview {
  std::vector<ConfigFault> faults;  ///< It would not run, or never track.
  std::vector<ConfigFault> doubts;  ///< It runs, but likely not as meant.
  std::vector<std::string> plan;    ///< What will run, a line each.

  void fault(std::string path, std::string value, std::string rule) {
    faults.push_back({{std::move(path), std::move(value), std::move(rule)}, ""});
  }
  void doubt(std::string path, std::string value, std::string rule) {
    doubts.push_back({{std::move(path), std::move(value), std::move(rule)}, ""});
  }
};

/// Opens every file that the configuration names, looks at devices and ports, and lets go of them
/// again. Writes nothing.
[[nodiscard]] ConfigReview review(const ServerConfig& config);

/// {"usable", "wrong": [{path, value, rule, where}], "doubtful": […], "will_run": […]}
[[nodiscard]] std::string review_json(const ConfigReview& review);

/// The parts of it.
void review_sensors(const ServerConfig& config, ConfigReview& review);
void review_room(const ServerConfig& config, ConfigReview& review);
void review_service(const ServerConfig& config, ConfigReview& review);

}  // namespace fiducap
