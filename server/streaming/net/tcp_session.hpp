#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/net/tcp_outbox.hpp"

namespace fiducap::net {

struct TcpSocket;
struct DeleteSocket {
  void operator()(TcpSocket* socket) const;
};
using Socket = std::unique_ptr<TcpSocket, DeleteSocket>;

/// One connection, as a TcpServer keeps it. Everything runs on the thread of the io_context.
///
/// Owned by shared_ptr: by the server's list and by the handlers under way.
class Session : public std::enable_shared_from_this<Session> {
 public:
  explicit Session(const Peer& peer) : peer_(peer) {}
  virtual ~Session() = default;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Once, when the server has taken it in.
  virtual void start() = 0;
  /// Judges the time limits; about ten times a second.
  virtual void tick(Instant now) = 0;
  /// Idempotent; says why in the log.
  virtual void close(std::string_view why, log::Level level = log::Level::kInfo) = 0;

  /// Gives its place up to a newcomer when all are taken.
  [[nodiscard]] virtual bool may_be_replaced(Instant) const { return false; }

  [[nodiscard]] bool closed() const { return closed_; }
  [[nodiscard]] const Peer& peer() const { return peer_; }

 protected:
  /// @return false when it was closed already
  bool close_once() { return !std::exchange(closed_, true); }

 private:
  Peer peer_;
  bool closed_{false};
};

/// One client's TCP socket: reads, writes what waits in the outbox, and closes a client that does
/// not read. A protocol derives from it and says what received bytes mean. What it throws closes
/// this session and no other.
class TcpSession : public Session {
 public:
  /// @param protocol  for the log, e.g. `vicon`; a literal
  TcpSession(Socket socket, std::string_view protocol, const Clock& clock);
  ~TcpSession() override;

  /// Starts reading and writes what already waits.
  void start() override;
  /// The newest frame; counts an older one that never left as dropped.
  void offer(SharedBytes frame);
  void tick(Instant now) final;
  void close(std::string_view why, log::Level level = log::Level::kInfo) final;

  /// `10.0.0.7:41522 tcp`
  [[nodiscard]] std::string peer_text() const { return text_of(peer()) + " tcp"; }
  [[nodiscard]] std::uint64_t frames_sent() const { return offered_ - dropped_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return dropped_; }
  [[nodiscard]] Instant since() const { return since_; }

 protected:
  /// Bytes cut anywhere. Answers go by `send`; may close.
  virtual void received(std::span<const std::byte> bytes) = 0;
  /// Once a tick, for limits of the protocol's own; may close.
  virtual void ticked(Instant) {}
  /// The wait of `wake_after` is over. Not called after the end.
  virtual void woken() {}
  void wake_after(Duration wait);
  /// Once, when it is closed.
  virtual void ended() {}
  /// Replies: appended whole, never dropped.
  void send(std::span<const std::byte> bytes);
  /// What encoders appended to; then `flush`.
  [[nodiscard]] std::vector<std::byte>& replies() { return outbox_.replies(); }
  void flush();
  /// The last frame has not left yet; the next one replaces it.
  [[nodiscard]] bool frame_waits() const { return outbox_.frame_waits(); }
  [[nodiscard]] const Clock& clock() const { return clock_; }

 private:
  struct Link;
  template <typename Work>
  void guard(Work&& work);
  [[nodiscard]] std::shared_ptr<TcpSession> self() {
    return std::static_pointer_cast<TcpSession>(shared_from_this());
  }
  void read();
  void take(std::size_t size);
  void write_rest(std::span<const std::byte> first, std::span<const std::byte> second);

  std::string_view protocol_;
  const Clock& clock_;
  Instant since_;
  TcpOutbox outbox_;
  std::unique_ptr<Link> link_;
  std::uint64_t offered_{0};
  std::uint64_t dropped_{0};
};

}  // namespace fiducap::net
