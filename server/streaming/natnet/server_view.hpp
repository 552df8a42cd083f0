#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/natnet/natnet_config.hpp"
#include "streaming/operator_desk.hpp"

namespace fiducap::natnet {

/// What answers to commands are made from.
struct ServerView {
  NatNetConfig config;
  OperatorDesk* desk{};  ///< nullptr: nothing can be changed.
  double rate_hz{};
  std::shared_ptr<const SceneModel> model;
  std::vector<BodyDescription> announced;  ///< The model with the names that clients see.
  std::shared_ptr<const SceneFrame> frame;  ///< The newest; may be nullptr.
};

/// May this peer change the server's state? The protocol knows no password.
[[nodiscard]] bool may_change(const ServerView& server, const Peer& from);
/// A node of a command: the name that clients see, our own name, or the streaming id. Disabled bodies are found too.
[[nodiscard]] std::optional<OperatorDesk::Body> find_body(const ServerView& server, std::string_view node);

}  // namespace fiducap::natnet
