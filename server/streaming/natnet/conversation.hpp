#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>

#include "base/time.hpp"
#include "streaming/natnet/codec.hpp"
#include "streaming/natnet/commands.hpp"
#include "streaming/natnet/frame_encoder.hpp"
#include "streaming/natnet/registry.hpp"

namespace fiducap::natnet {

/// The command port of a request. At the multicast port, replies name the group; clients that send
/// keep-alives there get unicast frames as well.
enum class Channel { kUnicast, kMulticast };

/// The protocol state of all clients, and their frames: datagram in → datagram out, time passed in,
/// no socket. Replies and frames are views, valid until the next call.
class Conversation final {
 public:
  /// No frames after a connect: a slow client takes them for the reply to its MODELDEF request.
  static constexpr Duration kHold = std::chrono::milliseconds(200);
  /// For frames with "model changed" or "bitstream changed".
  static constexpr Duration kAnnounce = std::chrono::milliseconds(200);

  /// @param key  random for each start of the server
  /// @param networks  of the clients
  /// @param epoch  of the frames' seconds
  Conversation(const NatNetConfig& config, std::shared_ptr<const SceneModel> model,
               OperatorApi* operator_api, double rate_hz, std::uint64_t key,
               net::TrustedNetworks networks, Instant epoch);

  /// @return the reply; empty: none
  [[nodiscard]] std::span<const std::byte> receive(std::span<const std::byte> datagram,
                                                   const Peer& from, Channel channel, Instant now);

  /// The last datagram was of a client of the multicast group.
  [[nodiscard]] bool asked_for_group() const { return asked_for_group_; }

  /// Sets the frame of `frame_for` and `multicast_frame`.
  void take(std::shared_ptr<const SceneFrame> frame, Instant now);
  /// @return empty: none for this client
  [[nodiscard]] std::span<const std::byte> frame_for(const Subscriber& subscriber, Instant now);
  [[nodiscard]] std::span<const std::byte> multicast_frame(Instant now);

  /// Removes timed-out clients; logs clients that left early. @return how many were removed
  std::size_t expire(Instant now);
  /// Its port is closed.
  bool remove(const Peer& peer) { return registry_.remove(peer); }
  /// The port of a client was closed before the reply arrived; removes and logs it.
  void reply_refused(const Peer& peer, Instant now);
  [[nodiscard]] std::span<Subscriber> subscribers() { return registry_.all(); }
  [[nodiscard]] std::span<const Subscriber> subscribers() const { return registry_.all(); }
  [[nodiscard]] const ServerView& server() const { return server_; }
  /// The ports in use, for replies. @pre before the first request
  void set_ports(std::uint16_t port, std::uint16_t unicast_port);

 private:
  struct Sender {
    Peer from;
    Channel channel{};
    Instant now;
    ReflectionGuard::Sender before;
    Subscriber* subscriber{};
  };
  using Bytes = std::span<const std::byte>;

  Bytes on(const ConnectRequest& request, Sender& sender);
  Bytes on(const DiscoveryRequest& request, Sender& sender);
  Bytes on(const KeepAliveRequest& request, Sender& sender);
  Bytes on(const DisconnectRequest& request, Sender& sender);
  Bytes on(const EchoRequest& request, Sender& sender);
  Bytes on(const ModelRequest& request, Sender& sender);
  Bytes on(const FrameRequest& request, Sender& sender);
  Bytes on(const CommandRequest& request, Sender& sender);

  void use(std::shared_ptr<const SceneModel> model);
  void warn_refused(const Sender& sender);
  void warn_listener(const Sender& sender);
  void subscribe(Sender& sender, Bitstream version, const std::string& name, Instant frames_from);
  void switch_to(Bitstream version, Sender& sender);
  [[nodiscard]] Bitstream version_for(const ClientVersions& versions, const Sender& sender) const;
  [[nodiscard]] Bitstream version_of(const Sender& sender) const;
  [[nodiscard]] Bytes info(Bitstream version, const Sender& sender);
  [[nodiscard]] Bytes frame(const FrameProfile& profile, Instant now);
  [[nodiscard]] Bytes reply(Datagram datagram);

  ServerView server_;
  Registry registry_;
  ReflectionGuard guard_;
  QuietConnects quiet_;
  CommandWords words_;
  FrameEncoder encoder_;
  bool loaded_{false};                          ///< The encoder has server_.frame.
  std::array<Datagram, kModelLayouts> models_;  ///< Encoded when first requested.
  Datagram reply_;
  bool asked_for_group_{false};
  Instant model_changed_until_{};
  bool recording_{false};
  Instant recording_asked_at_{};
};

}  // namespace fiducap::natnet
