#include "daemon/review/config_review.hpp"

#include <nlohmann/json.hpp>

namespace fiducap {

namespace {

nlohmann::json json_of(const std::vector<ConfigFault>& faults) {
  auto all = nlohmann::json::array();
  for (const auto& [error, where] : faults)
    all.push_back(
        {{"path", error.path}, {"value", error.value}, {"rule", error.rule}, {"where", where}});
  return all;
}

}  // namespace

std::string review_json(const ConfigReview& review) {
  const nlohmann::json all{{"usable", review.faults.empty()},
                           {"wrong", json_of(review.faults)},
                           {"doubtful", json_of(review.doubts)},
                           {"will_run", review.plan}};
  return all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

ConfigReview review(const ServerConfig& config) {
  ConfigReview found;
  if (config.bodies.empty()) found.fault("bodies", "[]", "must have at least one body");
  review_sensors(config, found);
  review_room(config, found);
  review_service(config, found);
  return found;
}

}  // namespace fiducap
