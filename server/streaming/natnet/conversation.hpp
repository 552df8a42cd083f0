#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "base/clock.hpp"
#include "streaming/natnet/answer.hpp"
#include "streaming/natnet/command_words.hpp"
#include "streaming/natnet/frame_encoder.hpp"
#include "streaming/natnet/quiet_connects.hpp"
#include "streaming/natnet/reflection_guard.hpp"
#include "streaming/natnet/registry.hpp"
#include "streaming/natnet/request.hpp"
#include "streaming/natnet/server_view.hpp"

namespace fiducap::natnet {

/// Which of the two command ports a request came to: at that of multicast, clients are told to join
/// the group. Who sends keep-alives there gets frames of its own all the same.
enum class Channel { kUnicast, kMulticast };

/// Requests that got no answer, by reason.
struct Unanswered {
  std::uint64_t malformed{};
  std::uint64_t too_much{};   ///< ReflectionGuard said no.
  std::uint64_t full{};       ///< No place for another client.
  std::uint64_t untrusted{};  ///< Wanted frames from a network that is not served.
};

/// The conversation with all clients and the frames they get: datagram in → datagram out, time
/// passed in, no socket.
///
/// Answers and frames are views that live until the next call.
class Conversation final {
 public:
  /// A slow client takes the datagram after its MODELDEF request for the answer, whatever it is.
  static constexpr Duration kHold = std::chrono::milliseconds(200);
  /// How long frames say "the model changed" or "the bitstream changed".
  static constexpr Duration kAnnounce = std::chrono::milliseconds(200);

  /// @param key  random for each start of the server
  /// @param networks  whose addresses may be clients
  /// @param epoch  where the frames' seconds begin
  Conversation(const NatNetConfig& config, std::shared_ptr<const SceneModel> model,
               OperatorDesk* desk, double rate_hz, std::uint64_t key, net::TrustedNetworks networks,
               Instant epoch);

  /// @return the answer; empty: none
  [[nodiscard]] std::span<const std::byte> receive(std::span<const std::byte> datagram,
                                                   const Peer& from, Channel channel, Instant now);

  /// The last datagram was that of a client that is served by the group.
  [[nodiscard]] bool asked_for_group() const { return asked_for_group_; }

  /// The frame that `frame_for` and `multicast_frame` are about from now on.
  void take(std::shared_ptr<const SceneFrame> frame, Instant now);
  /// @return empty: nothing for this client now
  [[nodiscard]] std::span<const std::byte> frame_for(const Subscriber& subscriber, Instant now);
  [[nodiscard]] std::span<const std::byte> multicast_frame(Instant now);

  /// Whoever was silent for too long goes; who went away for a reason is told of. @return how many
  /// clients went
  std::size_t expire(Instant now);
  /// Its port is closed, as its machine says.
  bool gone(const Peer& peer) { return registry_.remove(peer); }
  /// An answer came back: nobody listens where it was asked from. Said once in a while.
  void refused_answer(const Peer& peer, Instant now);
  [[nodiscard]] std::span<Subscriber> subscribers() { return registry_.all(); }
  [[nodiscard]] std::span<const Subscriber> subscribers() const { return registry_.all(); }
  [[nodiscard]] const Unanswered& unanswered() const { return unanswered_; }
  [[nodiscard]] const ServerView& server() const { return server_; }
  /// The ports really bound, for what clients are told. @pre before the first request
  void set_ports(std::uint16_t port, std::uint16_t unicast_port);

 private:
  struct Turn {
    Peer from;
    Channel channel{};
    Instant now;
    ReflectionGuard::Acquaintance before;
    Subscriber* subscriber{};
  };
  using Bytes = std::span<const std::byte>;

  Bytes on(const ConnectRequest& request, Turn& turn);
  Bytes on(const DiscoveryRequest& request, Turn& turn);
  Bytes on(const KeepAliveRequest& request, Turn& turn);
  Bytes on(const DisconnectRequest& request, Turn& turn);
  Bytes on(const EchoRequest& request, Turn& turn);
  Bytes on(const ModelRequest& request, Turn& turn);
  Bytes on(const FrameRequest& request, Turn& turn);
  Bytes on(const CommandRequest& request, Turn& turn);

  void use(std::shared_ptr<const SceneModel> model);
  void refuse(const Turn& turn);
  void warn_listener(const Turn& turn);
  void subscribe(Turn& turn, Bitstream version, const std::string& name, Instant frames_from);
  void switch_to(Bitstream version, Turn& turn);
  [[nodiscard]] Bitstream version_for(const ClientVersions& versions, const Turn& turn) const;
  [[nodiscard]] Bitstream version_of(const Turn& turn) const;
  [[nodiscard]] Bytes info(Bitstream version, const Turn& turn);
  [[nodiscard]] Bytes frame(const FrameProfile& profile, Instant now);
  [[nodiscard]] Bytes say(Datagram datagram);

  ServerView server_;
  Registry registry_;
  ReflectionGuard guard_;
  QuietConnects quiet_;
  CommandWords words_;
  FrameEncoder encoder_;
  bool loaded_{false};                          ///< The encoder has server_.frame.
  std::array<Datagram, kModelLayouts> models_;  ///< Encoded when first asked for.
  Datagram answer_;
  Unanswered unanswered_;
  bool asked_for_group_{false};
  Instant model_changed_until_{};
  bool recording_{false};
  Instant recording_asked_at_{};
};

}  // namespace fiducap::natnet
