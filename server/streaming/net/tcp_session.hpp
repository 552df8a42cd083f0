#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "streaming/net/tcp_outbox.hpp"

namespace fiducap::net {

/// Low latency, a send buffer that holds no stale seconds, and dead peers found within half a
/// minute.
void tune(boost::asio::ip::tcp::socket& socket);

/// One client's TCP socket: reads, writes what waits in the outbox, and closes a client that does
/// not read. A protocol derives from it and says what received bytes mean. Everything runs on the
/// thread of the io_context.
///
/// Owned by shared_ptr: by the server's list and by the handlers under way.
class TcpSession : public std::enable_shared_from_this<TcpSession> {
 public:
  using tcp = boost::asio::ip::tcp;

  /// @param protocol  for the log, e.g. `vicon`; a literal
  TcpSession(tcp::socket socket, std::string_view protocol, const Clock& clock);
  virtual ~TcpSession() = default;
  TcpSession(const TcpSession&) = delete;
  TcpSession& operator=(const TcpSession&) = delete;

  /// Starts reading and writes what already waits.
  void start();
  /// The newest frame; counts an older one that never left as dropped.
  void offer(SharedBytes frame);
  /// Judges the time limits; call about ten times a second.
  void tick(Instant now);
  /// Idempotent; says why in the log.
  void close(std::string_view why, log::Level level = log::Level::kInfo);

  [[nodiscard]] bool closed() const { return closed_; }
  [[nodiscard]] const std::string& peer() const { return peer_text_; }
  [[nodiscard]] const tcp::endpoint& endpoint() const { return endpoint_; }
  [[nodiscard]] std::uint64_t frames_sent() const { return offered_ - dropped_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return dropped_; }
  [[nodiscard]] Instant since() const { return since_; }

 protected:
  /// Bytes cut anywhere. Answers go by `send`; may close.
  virtual void received(std::span<const std::byte> bytes) = 0;
  /// Once a tick, for limits of the protocol's own; may close.
  virtual void ticked(Instant) {}
  /// Replies: appended whole, never dropped.
  void send(std::span<const std::byte> bytes);
  /// What encoders appended to; then `flush`.
  [[nodiscard]] std::vector<std::byte>& replies() { return outbox_.replies(); }
  void flush();
  /// The last frame has not left yet; the next one replaces it.
  [[nodiscard]] bool frame_waits() const { return outbox_.frame_waits(); }
  [[nodiscard]] const Clock& clock() const { return clock_; }

 private:
  void read();
  void write_rest(const std::array<boost::asio::const_buffer, 2>& buffers);

  tcp::socket socket_;
  tcp::endpoint endpoint_;
  std::string peer_text_;
  std::string_view protocol_;
  const Clock& clock_;
  Instant since_;
  TcpOutbox outbox_;
  std::array<std::byte, 16384> incoming_{};
  std::uint64_t offered_{0};
  std::uint64_t dropped_{0};
  bool closed_{false};
};

}  // namespace fiducap::net
