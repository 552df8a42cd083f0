#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/log.hpp"
#include "base/time.hpp"
#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// The bytes of one encoded frame, shared by all its readers.
using SharedBytes = std::shared_ptr<const std::vector<std::byte>>;

/// Bytes to be written to one client's TCP socket, without the socket.
///
/// Bounded: only the newest frame waits, an older one is dropped whole. All replies wait; a client
/// whose replies wait too long or grow too large must be closed.
class TcpOutbox final {
 public:
  static constexpr std::size_t kMaxReplyBytes = 1 << 20;
  static constexpr Duration kMaxWait = std::chrono::seconds(5);

  /// Appended whole, in order, before any waiting frame.
  void reply(std::span<const std::byte> bytes) {
    replies_.insert(replies_.end(), bytes.begin(), bytes.end());
  }
  /// For encoders that append whole messages.
  [[nodiscard]] std::vector<std::byte>& replies() { return replies_; }
  /// @return false when an older frame was dropped for this one
  bool offer(SharedBytes frame);
  /// The next offer drops a frame.
  [[nodiscard]] bool frame_waits() const { return frame_ != nullptr; }

  /// Pieces of one write, in this order; valid until `written`.
  using Pieces = std::array<std::span<const std::byte>, 2>;
  /// @return nullopt when nothing waits or the last write is not done
  [[nodiscard]] std::optional<Pieces> take(Instant now);
  /// The last write is complete.
  void written(Instant now);
  /// @return why this client must be closed
  [[nodiscard]] std::optional<std::string> overdue(Instant now);

 private:
  void note_waiting(Instant now);

  std::vector<std::byte> replies_;
  SharedBytes frame_;
  std::vector<std::byte> replies_in_flight_;
  SharedBytes frame_in_flight_;
  bool writing_{false};
  std::optional<Instant> in_flight_since_;
  std::optional<Instant> waiting_since_;  ///< Of replies.
};

struct TcpSocket;
struct DeleteSocket {
  void operator()(TcpSocket* socket) const;
};
using Socket = std::unique_ptr<TcpSocket, DeleteSocket>;

/// One connection of a TcpServer. Owned by the server's list and by pending handlers.
class Session : public std::enable_shared_from_this<Session> {
 public:
  explicit Session(const Peer& peer) : peer_(peer) {}
  virtual ~Session() = default;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Called once, after the server accepted it.
  virtual void start() = 0;
  /// Checks the time limits; about ten times a second.
  virtual void tick(Instant now) = 0;
  /// Idempotent; logs the reason.
  virtual void close(std::string_view why, log::Level level = log::Level::kInfo) = 0;

  /// May lose its place to a new connection when all are taken.
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

/// One client's TCP socket: reads, writes the outbox, and closes a client that does not read. A
/// protocol derives from it. An exception closes this session only.
class TcpSession : public Session {
 public:
  /// @param protocol  for the log, e.g. `vicon`; a literal
  TcpSession(Socket socket, std::string_view protocol, const Clock& clock);
  ~TcpSession() override;

  /// Starts reading and writes the outbox.
  void start() override;
  /// The newest frame; an older unsent one counts as dropped.
  void offer(SharedBytes frame);
  void tick(Instant now) final;
  void close(std::string_view why, log::Level level = log::Level::kInfo) final;

  /// `10.0.0.7:41522 tcp`
  [[nodiscard]] std::string peer_text() const { return text_of(peer()) + " tcp"; }
  [[nodiscard]] std::uint64_t frames_sent() const { return offered_ - dropped_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return dropped_; }
  [[nodiscard]] Instant since() const { return since_; }

 protected:
  /// Bytes cut anywhere. Replies by `send`; may close.
  virtual void received(std::span<const std::byte> bytes) = 0;
  /// Once per tick, for limits of the protocol; may close.
  virtual void ticked(Instant) {}
  /// The wait of `wake_after` is over. Not called after the end.
  virtual void woken() {}
  void wake_after(Duration wait);
  /// Called once, when it is closed.
  virtual void ended() {}
  /// Replies: appended whole, never dropped.
  void send(std::span<const std::byte> bytes);
  /// For encoders that append; then `flush`.
  [[nodiscard]] std::vector<std::byte>& replies() { return outbox_.replies(); }
  void flush();
  /// The last frame is not sent yet; the next one replaces it.
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
