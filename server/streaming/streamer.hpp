#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "scene/scene_frame.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap {

class CameraViews;
class OperatorDesk;
class SetupDesk;
namespace dds {
class Participant;
}

/// How the server's clock stands to a client's.
struct ClockOffset {
  double offset_s{};  ///< Server's clock minus the client's.
  double sigma_s{};   ///< As its measurement says: 1-sigma, or half of a round trip.
};

/// One client as the page lists it.
struct ClientStatus {
  std::string protocol;  ///< `vrpn`, `native`, `web`, …
  std::string peer;      ///< Address and transport, e.g. `127.0.0.1:41522 udp`
  std::string detail;    ///< What it receives, e.g. `z-up m, velocity on`
  std::uint64_t frames_sent{};
  std::uint64_t frames_dropped{};
  double connected_s{};
  std::optional<ClockOffset> clock{};  ///< Nothing: not measured in this protocol, or not yet.
};

/// One protocol server. It lives on one I/O thread, that of the frames or, where its configuration
/// says `kCanWait`, that of the pages; nothing here blocks.
class Streamer {
 public:
  virtual ~Streamer() = default;
  [[nodiscard]] virtual std::string_view protocol() const = 0;
  /// The first port that it listens on, also when the configuration asked for any free one; 0: it
  /// has none of its own.
  [[nodiscard]] virtual std::uint16_t port() const { return 0; }
  /// Encodes once, sends to every client; a slow client loses frames, nobody waits for it.
  virtual void publish(const std::shared_ptr<const SceneFrame>& frame) = 0;
  /// Appends one entry per connected client.
  virtual void append_clients(std::vector<ClientStatus>& out) const = 0;
  /// Closes everything; called once, on the I/O thread.
  virtual void stop() = 0;
};

/// What protocol servers are made from; everything outlives them.
struct ProtocolContext {
  boost::asio::io_context& io;  ///< Of the thread that it lives on.
  std::shared_ptr<const SceneModel> model;
  OperatorDesk& desk;
  const EventBoard& events;
  const Clock& clock;
  double rate_hz{};  ///< Of the frames.
  std::string_view version{};
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds{};
  /// Of all protocols; of those on the other thread as they were a moment ago.
  std::function<std::vector<ClientStatus>()> clients{};
  CameraViews* views{};  ///< nullptr: there are no pictures. For one protocol only.
  SetupDesk* setup{};    ///< nullptr: no set-up goes on.
};

}  // namespace fiducap
