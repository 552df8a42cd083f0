#include "daemon/review/config_review.hpp"

#include <algorithm>
#include <filesystem>

#include <net/if.h>
#include <unistd.h>
#include <boost/asio/io_context.hpp>
#include <nlohmann/json.hpp>

#include "daemon/bodies/body_setup.hpp"
#include "daemon/config/sockets.hpp"
#include "detection/tag_family.hpp"
#include "mapping/store/map_store.hpp"
#include "streaming/net/bind.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

/// Ids that the family does not have can never be seen.
void review_ids(const ServerConfig& config, ConfigReview& review) {
  const auto family = TagFamily::named(config.tags.family);
  if (!family) return;
  const auto check = [&](const std::string& path, int id) {
    if (id >= 0 && id < family->ids()) return;
    review.fault(path, std::to_string(id),
                 "is no tag of " + config.tags.family + ", which has 0 to " +
                     std::to_string(family->ids() - 1));
  };
  for (const auto& [id, size] : config.tags.sizes_m) check("tags.sizes_m", id);
  for (const int id : config.tags.ignore) check("tags.ignore", id);
  for (const int id : config.map.floor_tags) check("map.floor_tags", id);
  if (!config.map.reference_tag) return;
  const int reference = *config.map.reference_tag;
  check("map.reference_tag", reference);
  if (std::ranges::find(config.tags.ignore, reference) != config.tags.ignore.end())
    review.fault("map.reference_tag", std::to_string(reference),
                 "is in tags.ignore: it would never be seen");
}

std::optional<std::size_t> stored_tags(const std::string& store, ConfigReview& review) {
  std::error_code ignored;
  if (store.empty() || !fs::exists(store, ignored)) return std::nullopt;
  const auto opened = MapStore::open_to_read(store);
  const auto map = opened ? opened->newest() : tl::unexpected(opened.error());
  if (map) return map->tags.size();
  review.fault("map.store", store, map.error().what);
  return std::nullopt;
}

void review_folder_of(const std::string& store, ConfigReview& review) {
  std::error_code ignored;
  const fs::path folder = fs::absolute(store, ignored).parent_path();
  if (!fs::is_directory(folder, ignored)) {
    // Below /var/lib: the service has not been started yet.
    if (folder.string().starts_with("/var/lib/"))
      return review.doubt("map.store", store,
                          "its folder does not exist yet: systemd makes it with the service. Make "
                          "it first to start fiducapd by hand");
    return review.fault("map.store", store, "its folder does not exist: make it first");
  }
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    review.fault("map.store", store, "this user may not write to its folder");
}

void review_map_files(const ServerConfig& config, ConfigReview& review) {
  const MapSettings& map = config.map;
  std::error_code ignored;
  const bool has_file = !map.file.empty() && fs::exists(map.file, ignored);
  if (!map.file.empty() && !has_file) review.fault("map.file", map.file, "there is no such file");
  if (!map.store.empty()) review_folder_of(map.store, review);
  const auto stored = stored_tags(map.store, review);
  const bool has_map = has_file || stored.value_or(0) > 0;
  if (map.builder.mode == MapMode::kFrozen && !has_map)
    review.fault("map.mode", "frozen",
                 "has no map: nothing will ever be tracked. Begin with `mapping`, or name a map in "
                 "map.file or map.store");
  std::string line = map.builder.mode == MapMode::kFrozen ? "a frozen map" : "a growing map";
  if (stored) line += ", " + std::to_string(*stored) + " tags stored in " + map.store;
  if (has_file && stored.value_or(0) == 0) line += ", beginning with " + map.file;
  review.plan.push_back(line + "; tags " + config.tags.family + ", " +
                        std::to_string(static_cast<int>(1e3 * config.tags.size_m + 0.5)) + " mm");
}

void review_gauge(const ServerConfig& config, ConfigReview& review) {
  const MapSettings& map = config.map;
  const bool begins = map.file.empty() && map.builder.mode == MapMode::kMapping;
  if (!begins) return;
  if (!map.reference_tag)
    review.doubt(
        "map.reference_tag", "null",
        "is not set: the first tag that is seen becomes the origin, another one next time");
  const bool has_imu = std::ranges::any_of(config.bodies, [&](const BodyConfig& body) {
    const auto setup = read_body_setup(body, config.simulation, config.site);
    return setup && setup->sensors.imu;
  });
  if (!has_imu && !map.reference_pose && map.floor_tags.empty())
    review.doubt("map.floor_tags", "[]",
                 "the vertical is unknown: no body has an IMU. Name three tags that lie flat on "
                 "the floor, or set map.reference_pose");
}

/// Tries to open a port like the server.
std::optional<std::string> fault_of(const OwnSocket& socket) {
  const net::BindTarget target{socket.address, socket.port.number, socket.section, socket.port.key};
  boost::asio::io_context io;
  if (socket.port.udp) {
    const auto bound = net::bind_udp(io, target);
    return bound ? std::nullopt : std::optional(bound.error().text());
  }
  const auto bound = net::listen_tcp(io, target);
  return bound ? std::nullopt : std::optional(bound.error().text());
}

/// Ports of IMUs are opened by review_sensors.
void review_ports(const StreamingConfig& streaming, ConfigReview& review) {
  for (const ServedProtocol& protocol : served_protocols(streaming)) {
    if (!protocol.enabled) continue;
    const std::string name(protocol.name);
    std::string line = name + " on " + protocol.address + ":";
    for (const OwnSocket& socket : sockets_of(protocol)) {
      line += " " + text_of(socket.port);
      const auto fault = socket.port.number == 0 ? std::nullopt : fault_of(socket);
      if (!fault) continue;
      if (streaming.is_optional(name))
        review.doubt(socket.key(), socket.value(), *fault + " (optional: the server runs without)");
      else if (socket.port.optional)
        review.doubt(socket.key(), socket.value(), *fault + " (" + name + " is served without)");
      else
        review.fault(socket.key(), socket.value(), *fault);
    }
    review.plan.push_back(line);
  }
}

void add_checks(const std::vector<ConfigCheck>& checks, ConfigReview& review) {
  for (const ConfigCheck& one : checks) {
    auto& all = one.is_fault ? review.faults : review.doubts;
    all.push_back({{one.path, one.value, one.text + ": " + one.remedy}, ""});
  }
}

nlohmann::json json_of(const std::vector<ConfigFault>& faults) {
  auto all = nlohmann::json::array();
  for (const auto& [error, where] : faults)
    all.push_back(
        {{"path", error.path}, {"value", error.value}, {"rule", error.rule}, {"where", where}});
  return all;
}

/// Ports, tokens, folders.
void review_service(const ServerConfig& config, ConfigReview& review) {
  if (const auto tokens = with_tokens(config.operators, nullptr); !tokens) {
    const bool is_read = tokens.error().context == config.operators.read_token_file;
    review.fault(is_read ? "operator.read_token_file" : "operator.token_file",
                 tokens.error().context, tokens.error().what);
  }
  const std::string& card = config.dds.interface;
  const bool is_name = !card.empty() && card.find_first_not_of("0123456789.:") != std::string::npos;
  if (is_name && ::if_nametoindex(card.c_str()) == 0)
    review.fault("dds.interface", card, "is no network interface of this machine (`ip link`)");
  review_ports(config.streaming, review);
  add_checks(access_checks(config), review);
  add_checks(storage_checks(config, recordings_of(config)), review);
}

}  // namespace

FolderFacts folder_facts(const fs::path& path) {
  std::error_code unknown;
  fs::path existing = fs::absolute(path, unknown);
  while (!fs::exists(existing, unknown) && existing.has_relative_path())
    existing = existing.parent_path();
  FolderFacts facts{path.string(), false, std::nullopt};
  if (!fs::is_directory(existing, unknown))
    facts.obstacle = existing.string() + " is no folder";
  else if (::access(existing.c_str(), W_OK | X_OK) != 0)
    facts.obstacle = "this user may not write to " + existing.string();
  facts.writable = facts.obstacle.empty();
  const auto space = fs::space(existing, unknown);
  if (!unknown) facts.free_bytes = space.available;
  return facts;
}

FolderFacts recordings_of(const ServerConfig& config) {
  return folder_facts(config.recorder.folder.empty() ? "recordings" : config.recorder.folder);
}

std::vector<ConfigCheck> access_checks(const ServerConfig& config) {
  std::vector<ConfigCheck> all;
  for (std::size_t i = 0; i < config.bodies.size(); ++i) {
    const BodyConfig& body = config.bodies[i];
    const auto* link = body.imu_source && body.use_imu ? body.imu_source->link() : nullptr;
    if (link != nullptr && link->takes_the_first_sender())
      all.push_back({false, "bodies." + std::to_string(i) + ".imu_source.peer", "none",
                     "the IMU of " + body.name + " on UDP port " + std::to_string(link->port) +
                         " belongs to the first sender",
                     "name its address with imu_source.peer, or listen on address: 127.0.0.1"});
  }
  return all;
}

std::vector<ConfigCheck> storage_checks(const ServerConfig& config, const FolderFacts& recordings) {
  std::vector<ConfigCheck> all;
  if (config.map.store.empty() && config.map.builder.mode == MapMode::kMapping)
    all.push_back({false, "map.store", "\"\"",
                   "the map is lost when the server ends, and another one begins",
                   "map.store: a file"});
  if (!recordings.writable)
    all.push_back(
        {true, "recorder.folder", config.recorder.folder,
         "recordings cannot be written to " + recordings.path +
             (recordings.obstacle.empty() ? "" : " (" + recordings.obstacle + ")"),
         "make the folder writable for the user that runs fiducapd, or change recorder.folder"});
  return all;
}

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
  review_ids(config, found);
  review_map_files(config, found);
  review_gauge(config, found);
  review_service(config, found);
  return found;
}

}  // namespace fiducap
