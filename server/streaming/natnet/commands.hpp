#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/natnet.hpp"
#include "streaming/natnet/registry.hpp"
#include "streaming/operator_api.hpp"

namespace fiducap::natnet {

/// The data for replies to commands.
struct ServerView {
  NatNetConfig config;
  OperatorApi* operator_api{};  ///< nullptr: read-only.
  double rate_hz{};
  std::shared_ptr<const SceneModel> model;
  std::vector<BodyDescription> announced;   ///< The model with names for clients.
  std::shared_ptr<const SceneFrame> frame;  ///< The newest; may be nullptr.
};

/// Replies to all text commands that clients are known to send; others: UNRECOGNIZED_REQUEST.
///
/// A reply is a number in 4 bytes (0: done, else refused) or text. Commands of the timeline are
/// accepted and do nothing, because clients send them with others. Commands that change something
/// are executed by OperatorApi, if `remote_control` permits it.
///
/// `GetProperty,<node>,<name>`, `GetProperty,,<name>` or `GetProperty,<name>`;
/// `SetProperty,<node>,<name>,<value>`. Case and blanks in names do not matter. Of a body: Name,
/// Active (Enabled), StreamingID (AssetID, ID), TrackingValid; the first two can be set. Of the
/// server: FrameRate (Master Rate), UpAxis, Units, Bitstream, Name, DataPort, MulticastAddress,
/// CommandPort, TransmissionType.
class CommandWords final {
 public:
  struct Asker {
    Peer peer;
    bool multicast{};
    Bitstream version;         ///< Current.
    Subscriber* subscriber{};  ///< nullptr: no unicast frames. Its selection may be changed.
  };
  struct Answer {
    Datagram datagram;
    std::optional<Bitstream> switch_to{};  ///< Its new version.
    bool leaves{};
  };

  [[nodiscard]] Answer answer(std::string_view text, const ServerView& server, const Asker& asker);

 private:
  std::string next_take_;  ///< Name of the next recording; empty: date and time.
};

}  // namespace fiducap::natnet
