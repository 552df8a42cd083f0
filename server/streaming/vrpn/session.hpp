#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "streaming/net/datagram_batch.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vrpn/connection.hpp"
#include "streaming/vrpn/report_encoder.hpp"

namespace fiducap::vrpn {

/// What the sessions of one server share. Lives as long as the last of their handlers.
struct SessionContext {
  VrpnConfig config;
  const Clock& clock;
  SenderTable senders{config.aliases};
  Duration utc_offset{};  ///< Of the newest frame; zero before the first.
  /// Of the next message. One count for all clients: they look at it, if at all, for jumps in a
  /// log.
  std::uint32_t sequence{0};
  int log_lines_left{0};  ///< Refilled once a second: clients cannot flood the log.
  int log_lines_lost{0};

  [[nodiscard]] std::int64_t utc_ns(Instant now) const { return to_ns(now) + utc_offset.count(); }
  void say(log::Level level, const std::string& text);
};

/// One client's TCP socket and its conversation. Reports that go by UDP are sent by the server.
class Session final : public net::TcpSession {
 public:
  static constexpr Duration kCookieTime = std::chrono::seconds(5);

  Session(std::shared_ptr<SessionContext> context, net::Socket socket, Origin origin);

  /// Says the cookie at once: some clients wait for it.
  void start() override;
  void describe_new_senders();
  /// Whole messages, numbered, by TCP.
  void send_reliable(std::span<const std::byte> messages) { send(messages); }

  [[nodiscard]] bool open() const { return !closed() && connection_.open(); }
  [[nodiscard]] Origin origin() const { return origin_; }
  /// Where it wants reports; nothing: by TCP.
  [[nodiscard]] std::optional<std::uint16_t> udp_port() const { return connection_.udp_port(); }
  [[nodiscard]] ClientStatus status(Instant now) const;

  net::DatagramShare datagrams;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;
  [[nodiscard]] std::string transport_text() const;

  std::shared_ptr<SessionContext> context_;
  Origin origin_;
  Connection connection_;
  std::optional<Instant> open_since_;
};

}  // namespace fiducap::vrpn
