#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "base/log.hpp"
#include "base/time.hpp"
#include "scene/scene_frame.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap {

class CameraViews;
class OperatorApi;
class SetupApi;
namespace dds {
class Participant;
using JoinDomain = std::function<Expected<std::shared_ptr<Participant>>()>;
}  // namespace dds

/// Offset between the server's clock and a client's.
struct ClockOffset {
  double offset_s{};  ///< Server's clock minus the client's.
  double sigma_s{};   ///< 1-sigma, or half of a round trip.
};

/// One client in the page's list.
struct ClientStatus {
  std::string protocol;  ///< `vrpn`, `native`, `web`, …
  std::string peer;      ///< Address and transport, e.g. `127.0.0.1:41522 udp`
  std::string detail;    ///< What it receives, e.g. `z-up m, velocity on`
  std::uint64_t frames_sent{};
  std::uint64_t frames_dropped{};
  double connected_s{};
  std::optional<ClockOffset> clock{};  ///< nullopt: not measured.
};

/// One protocol server. Lives on the I/O thread of the frames or, when its configuration has
/// `kCanWait`, on that of the pages; never blocks.
class Streamer {
 public:
  /// @param protocol  its name, a literal
  explicit Streamer(std::string_view protocol) : protocol_(protocol) {}
  virtual ~Streamer() = default;
  [[nodiscard]] std::string_view protocol() const { return protocol_; }
  /// The first port that it listens on, also when any free one was configured; 0: it has none.
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// A further UDP port: for discovery (qualisys) or unicast clients (natnet); 0: none.
  [[nodiscard]] std::uint16_t second_port() const { return second_port_; }
  /// Encodes once, sends to every client; a slow client loses frames.
  virtual void publish(const std::shared_ptr<const SceneFrame>& frame) = 0;
  /// Appends one entry per connected client.
  virtual void append_clients(std::vector<ClientStatus>& out) const = 0;
  /// Closes everything; called once, on the I/O thread.
  virtual void stop() = 0;

 protected:
  std::uint16_t port_{0};
  std::uint16_t second_port_{0};

 private:
  std::string_view protocol_;
};
using StartedStreamer = Expected<std::unique_ptr<Streamer>>;

/// Inputs of all protocol servers; everything outlives them.
struct ProtocolContext {
  boost::asio::io_context& io;  ///< Of the server's thread.
  std::shared_ptr<const SceneModel> model;
  const Clock& clock;
  OperatorApi* operator_api{};  ///< nullptr: no client can change anything.
  const EventBoard* events{};   ///< nullptr: no events.
  double rate_hz{};             ///< Of the frames.
  std::string_view version{};
  dds::JoinDomain join_dds{};  ///< Called at the start and later, from any thread.
  /// Of all protocols; those of the other thread with a short delay. On the thread of `io` only.
  std::function<std::vector<ClientStatus>()> clients{};
  CameraViews* views{};  ///< nullptr: no pictures. For one protocol only.
  SetupApi* setup{};     ///< nullptr: no set-up is running.
};

/// Gives each frame to every protocol of one I/O thread. An exception costs one protocol one frame.
class StreamHub final {
 public:
  void add(std::unique_ptr<Streamer> streamer) { streamers_.push_back(std::move(streamer)); }

  [[nodiscard]] bool empty() const { return streamers_.empty(); }

  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    each([&](Streamer& streamer) { streamer.publish(frame); });
    if (wanted_) show_clients();
  }
  [[nodiscard]] std::vector<ClientStatus> clients() {
    std::vector<ClientStatus> all;
    each([&](const Streamer& streamer) { streamer.append_clients(all); });
    return all;
  }
  /// From any thread: the clients at the first frame after the previous call.
  [[nodiscard]] std::shared_ptr<const std::vector<ClientStatus>> shown_clients() {
    wanted_ = true;
    const std::lock_guard lock(showing_);
    return shown_;
  }
  void stop() {
    each([](Streamer& streamer) { streamer.stop(); });
  }

 private:
  void show_clients() {
    log::guarded(
        "streaming", [] { return "the list of clients"; },
        [this] {
          auto now = std::make_shared<const std::vector<ClientStatus>>(clients());
          // Frames do not wait for a reader that holds the lock.
          const std::unique_lock lock(showing_, std::try_to_lock);
          if (!lock) return;
          shown_.swap(now);
          wanted_ = false;
        });
  }
  template <typename Work>
  void each(Work&& work) {
    // The first failure and one of a thousand are logged.
    const auto whose = [this] {
      return failures_++ % 1000 == 0 ? std::string("a frame") : std::string();
    };
    for (const auto& streamer : streamers_)
      log::guarded(streamer->protocol(), whose, [&] { work(*streamer); });
  }

  std::vector<std::unique_ptr<Streamer>> streamers_;
  std::uint64_t failures_{0};
  std::atomic<bool> wanted_{false};
  std::mutex showing_;
  std::shared_ptr<const std::vector<ClientStatus>> shown_{
      std::make_shared<const std::vector<ClientStatus>>()};
};

}  // namespace fiducap
