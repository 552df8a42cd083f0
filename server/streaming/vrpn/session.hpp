#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/clock.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vrpn/connection.hpp"
#include "streaming/vrpn/outbox.hpp"

namespace fiducap::vrpn {

/// What the sessions of one server share. Lives as long as the last of their handlers.
struct SessionContext {
  VrpnConfig config;
  const Clock& clock;
  SenderTable senders{};
  Duration utc_offset{};  ///< Of the newest frame; zero before the first.
  int log_lines_left{0};  ///< Refilled once a second: clients cannot flood the log.
  int log_lines_lost{0};

  [[nodiscard]] std::int64_t utc_ns(Instant now) const { return to_ns(now) + utc_offset.count(); }
  void say(log::Level level, const std::string& text);
};

/// One client's sockets: carries bytes between them and its Connection, and closes what does not behave.
class Session final : public std::enable_shared_from_this<Session> {
 public:
  using tcp = boost::asio::ip::tcp;
  using udp = boost::asio::ip::udp;
  static constexpr Duration kConnectTime = std::chrono::seconds(3);
  static constexpr Duration kCookieTime = std::chrono::seconds(5);

  Session(std::shared_ptr<SessionContext> context, tcp::socket socket, tcp::endpoint peer, Origin origin);

  /// kDirect: the socket is connected. kRequested: connects to `peer` first.
  void start();
  /// A frame's reports, by UDP when the client asked for that, else by TCP behind what waits there.
  /// @param numbered  the bytes of `frame`, scratch for this client's sequence numbers
  void publish(const std::shared_ptr<const EncodedFrame>& frame, std::span<std::byte> numbered);
  void describe_new_senders();
  /// Whole messages by TCP, to open connections only.
  void send_reliable(std::span<const std::byte> messages);
  /// Judges all time limits.
  void tick(Instant now);
  /// @param level  of the log line; an open client's end is always told.
  void close(std::string_view why, log::Level level = log::Level::kDebug);

  [[nodiscard]] bool closed() const { return state_ == State::kClosed; }
  [[nodiscard]] bool connecting() const { return state_ == State::kConnecting; }
  [[nodiscard]] bool open() const { return state_ == State::kConnected && connection_.open(); }
  [[nodiscard]] const tcp::endpoint& peer() const { return peer_; }
  [[nodiscard]] Origin origin() const { return origin_; }
  [[nodiscard]] ClientStatus status(Instant now) const;

 private:
  enum class State { kConnecting, kConnected, kClosed };

  void connected();
  void read();
  void received(std::size_t n);
  void open_udp(std::uint16_t port);
  void send_udp(const EncodedFrame& frame, std::span<std::byte> numbered);
  void pump();
  [[nodiscard]] std::string peer_text() const;

  std::shared_ptr<SessionContext> context_;
  tcp::socket socket_;
  tcp::endpoint peer_;
  Origin origin_;
  Connection connection_;
  Outbox outbox_;
  State state_{State::kConnecting};
  Instant since_;  ///< Of the present state.
  std::array<std::byte, 16384> incoming_{};
  std::vector<std::byte> writing_;
  std::optional<udp::socket> udp_;
  std::optional<std::uint16_t> udp_port_;
  std::uint32_t udp_sequence_{0};
  std::uint64_t frames_offered_{0};
  std::uint64_t frames_dropped_{0};
};

}  // namespace fiducap::vrpn
