#include "capture/ros/ros_config.hpp"

#include <algorithm>
#include <cctype>

namespace fiducap::dds {

namespace {

bool is_topic(const std::string& name) {
  const auto good = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '/'; };
  return name.size() >= 2 && name.size() <= 200 && name.front() == '/' && name.back() != '/' &&
         name.find("//") == std::string::npos && std::all_of(name.begin(), name.end(), good);
}

}  // namespace

std::vector<ConfigError> RosSourceConfig::check(const std::string& prefix) const {
  Checker checker{prefix};
  checker.within("camera_info_wait_s", camera_info_wait_s, 0, 600)
      .require(!images.empty() && images.size() <= 16, "images",
               std::to_string(images.size()) + " entries", "must name 1 to 16 topics")
      .require(imu.empty() || is_topic(imu), "imu", '"' + imu + '"',
               "must be a topic, e.g. /imu/data");
  for (const auto& topic : images) {
    checker.require(is_topic(topic), "images", '"' + topic + '"',
                    "must be topics, e.g. /camera/image_raw");
  }
  return checker.errors;
}

RosSourceConfig RosCameraConfig::as_source() const {
  return {.images = {image},
          .imu = "",
          .reliable = reliable,
          .synchronized = synchronized,
          .camera_info_wait_s = camera_info_wait_s};
}

std::vector<ConfigError> RosCameraConfig::check(const std::string& prefix) const {
  return Checker{prefix}
      .within("camera_info_wait_s", camera_info_wait_s, 0, 600)
      .require(is_topic(image), "image", '"' + image + '"',
               "must be a topic, e.g. /camera/image_raw")
      .errors;
}

std::vector<ConfigError> check_source(const RosSourceConfig& config,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  Checker rules{body_prefix, config.check(body_prefix + "source.")};
  rules
      .require(around.cameras.size() == config.images.size(), "cameras",
               std::to_string(around.cameras.size()) + " entries",
               "a ros source has one camera per topic in source.images")
      .require(config.imu.empty() || !around.has_imu_source, "imu_source", "{…}",
               "stands beside source.imu: which of the two is it?");
  return rules.errors;
}

}  // namespace fiducap::dds
