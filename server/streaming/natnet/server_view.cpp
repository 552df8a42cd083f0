#include "streaming/natnet/server_view.hpp"

#include <algorithm>
#include <charconv>

namespace fiducap::natnet {

namespace {

std::vector<OperatorDesk::Body> all_bodies(const ServerView& server) {
  if (server.desk != nullptr) return server.desk->bodies();
  std::vector<OperatorDesk::Body> bodies;
  for (const auto& body : server.model->bodies) bodies.push_back({body.id, body.name, true, Pose{}});
  return bodies;
}

std::optional<int> number_in(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

bool may_change(const ServerView& server, const Peer& from) {
  if (server.desk == nullptr) return false;
  switch (server.config.remote_control) {
    case RemoteControl::kOff: return false;
    case RemoteControl::kLoopback: return from.is_loopback();
    case RemoteControl::kAll: return true;
  }
  return false;
}

std::optional<OperatorDesk::Body> find_body(const ServerView& server, std::string_view node) {
  const auto bodies = all_bodies(server);
  const auto with = [&](const auto& holds) -> std::optional<OperatorDesk::Body> {
    const auto at = std::find_if(bodies.begin(), bodies.end(), holds);
    if (at == bodies.end()) return std::nullopt;
    return *at;
  };
  for (const auto& shown : server.announced) {
    if (shown.name == node) return with([&](const auto& body) { return body.id == shown.id; });
  }
  if (const auto own = with([&](const auto& body) { return body.name == node; })) return own;
  const NameRule rule = server.config.name_rule();
  if (const auto hidden = with([&](const auto& body) {
        return client_name(body.name, rule, server.config.aliases) == node;
      })) {
    return hidden;
  }
  const auto id = number_in(node);
  return id ? with([&](const auto& body) { return body.id == *id; }) : std::nullopt;
}

}  // namespace fiducap::natnet
