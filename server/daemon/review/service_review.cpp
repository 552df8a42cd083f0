// Who is served: ports, tokens, folders.
#include <net/if.h>
#include <unistd.h>
#include <filesystem>
#include <map>

#include <boost/asio/io_context.hpp>

#include "daemon/operator_token.hpp"
#include "daemon/protocol_servers.hpp"
#include "daemon/review/config_review.hpp"
#include "streaming/net/bind.hpp"

namespace fiducap {

namespace {

namespace fs = std::filesystem;

/// Tries a port as the protocol would, and lets go of it.
std::optional<std::string> fault_of(const ServedProtocol& protocol, const PortUse& port) {
  const std::string key = "streaming." + std::string(protocol.name);
  const net::BindTarget target{protocol.address, port.number, key};
  boost::asio::io_context io;
  if (port.udp) {
    const auto bound = net::bind_udp(io, target);
    return bound ? std::nullopt : std::optional(bound.error().text());
  }
  const auto bound = net::listen_tcp(io, target);
  return bound ? std::nullopt : std::optional(bound.error().text());
}

bool is_optional(const StreamingConfig& streaming, std::string_view protocol) {
  const auto& names = streaming.optional;
  return std::find(names.begin(), names.end(), protocol) != names.end();
}

class PortReview final {
 public:
  PortReview(const StreamingConfig& streaming, ConfigReview& review)
      : streaming_(streaming), review_(review) {}

  void look_at(const ServedProtocol& protocol) {
    if (!protocol.enabled) return;
    std::string line = std::string(protocol.name) + " on " + protocol.address + ":";
    for (const PortUse& port : protocol.ports) {
      line += " " + std::to_string(port.number) + (port.udp ? " udp" : " tcp");
      if (port.number != 0) look_at(protocol, port);
    }
    review_.plan.push_back(line);
  }

 private:
  void look_at(const ServedProtocol& protocol, const PortUse& port) {
    const std::string path = "streaming." + std::string(protocol.name);
    const auto [other, fresh] = taken_.try_emplace({port.number, port.udp}, protocol.name);
    if (!fresh)
      return review_.fault(path, std::to_string(port.number),
                           "is the port of " + other->second + ", too");
    const auto fault = fault_of(protocol, port);
    if (!fault) return;
    if (is_optional(streaming_, protocol.name)) {
      review_.doubt(path, std::to_string(port.number),
                    *fault + " (optional: the server runs without)");
    } else {
      review_.fault(path, std::to_string(port.number), *fault);
    }
  }

  const StreamingConfig& streaming_;
  ConfigReview& review_;
  std::map<std::pair<std::uint16_t, bool>, std::string> taken_;
};

void review_folder(const std::string& path, const std::string& folder, ConfigReview& review) {
  std::error_code ignored;
  fs::path at = folder.empty() ? fs::current_path(ignored) : fs::absolute(folder, ignored);
  while (!at.empty() && !fs::exists(at, ignored) && at.has_parent_path() && at != at.parent_path())
    at = at.parent_path();
  if (!fs::is_directory(at, ignored))
    return review.fault(path, folder, at.string() + " is no folder");
  if (::access(at.c_str(), W_OK | X_OK) != 0)
    review.fault(path, folder, "this user may not write to " + at.string());
}

}  // namespace

void review_service(const ServerConfig& config, ConfigReview& review) {
  if (const auto token = operator_token(config.operators, nullptr); !token)
    review.fault("operator.token_file", config.operators.token_file, token.error().what);
  const std::string& card = config.dds.interface;
  const bool is_name = !card.empty() && card.find_first_not_of("0123456789.:") != std::string::npos;
  if (is_name && ::if_nametoindex(card.c_str()) == 0)
    review.fault("dds.interface", card, "is no network interface of this machine (`ip link`)");
  PortReview ports(config.streaming, review);
  for (const ServedProtocol& protocol : served_protocols(config.streaming)) ports.look_at(protocol);
  const web::WebConfig& web = config.streaming.web;
  ports.look_at({"web", web.enabled, web.address, {{web.port, false}}, {}, {}});
  review_folder("recorder.folder", config.recorder.folder, review);
}

}  // namespace fiducap
