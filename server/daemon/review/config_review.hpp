#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
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

/// A folder, or the nearest existing one in which it will be made.
struct FolderFacts {
  std::string path;
  bool writable{};
  std::optional<std::uint64_t> free_bytes;
  std::string obstacle{};  ///< Why it is not writable.
};
[[nodiscard]] FolderFacts folder_facts(const std::filesystem::path& path);

/// A condition of a configuration that is reported, by `--check-config` and by `fiducap doctor`.
struct ConfigCheck {
  bool is_fault{};   ///< Else a doubt.
  std::string path;  ///< Of the configuration.
  std::string value;
  std::string text;
  std::string remedy;
};
/// Which machines may send to the server.
[[nodiscard]] std::vector<ConfigCheck> access_checks(const ServerConfig& config);
/// Whether map and recordings are kept. @param recordings  the folder of the configuration
[[nodiscard]] std::vector<ConfigCheck> storage_checks(const ServerConfig& config,
                                                      const FolderFacts& recordings);

/// The folder for recordings of a configuration.
[[nodiscard]] FolderFacts recordings_of(const ServerConfig& config);

/// The part of a review about bodies.
void review_sensors(const ServerConfig& config, ConfigReview& review);

}  // namespace fiducap
