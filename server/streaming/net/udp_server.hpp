#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/expected.hpp"
#include "middleware/net/peer.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::net {

/// Many datagrams to many addresses by as few system calls as the kernel allows; never waits.
///
/// `clear`, `add` for every datagram, `send`. Keeps its memory: nothing is allocated per frame.
/// Bytes are not copied: they must live until `send`.
class DatagramBatch final {
 public:
  void clear();
  void add(std::span<const std::byte> datagram, const SocketAddress& address);
  /// Many datagrams to one address as one message: the kernel cuts `bytes` every `cut` bytes, the
  /// last may be shorter. Where it cannot (old kernel, no such device), `send` cuts.
  void add_cut(std::span<const std::byte> bytes, std::size_t cut, const SocketAddress& address);
  /// Skips a datagram that the socket refuses (buffer full, no route).
  void send(int socket);

  /// Messages so far: one per `add`, one or more per `add_cut`.
  [[nodiscard]] std::size_t size() const { return messages_.size(); }
  /// After `send`: the socket took the whole i-th message.
  [[nodiscard]] bool sent(std::size_t i) const { return sent_[i]; }

 private:
  struct Cut {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint16_t))> control{};
    std::size_t bytes{0};  ///< 0: not cut.
  };
  void point_at_memory();
  [[nodiscard]] bool send_cut_by_hand(int socket, std::size_t i) const;

  std::vector<SocketAddress> addresses_;
  std::vector<iovec> pieces_;
  std::vector<Cut> cuts_;
  std::vector<mmsghdr> messages_;
  std::vector<bool> sent_;
};

/// The messages of the current batch that belong to one client, and its counts of sent frames.
class DatagramShare final {
 public:
  void clear() { begin_ = end_ = 0; }
  void open(const DatagramBatch& batch) { begin_ = batch.size(); }
  void close(const DatagramBatch& batch) { end_ = batch.size(); }
  /// The same messages, sent to both clients at once.
  void share(const DatagramShare& other) {
    begin_ = other.begin_;
    end_ = other.end_;
  }
  /// After the batch was sent: a frame counts as sent when the socket took all its messages.
  void settle(const DatagramBatch& batch);
  /// A frame too long for any datagram.
  void drop() { ++dropped_; }

  [[nodiscard]] std::uint64_t frames_sent() const { return sent_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return dropped_; }

 private:
  std::size_t begin_{0};
  std::size_t end_{0};
  std::uint64_t sent_{0};
  std::uint64_t dropped_{0};
};

struct UdpOptions {
  std::string_view protocol;     ///< For the log, e.g. `natnet`; a literal.
  std::size_t longest{2048};     ///< Bytes; a longer datagram is cut.
  bool shared{false};            ///< Other sockets of this machine may receive the same broadcasts.
  bool broadcasts{false};        ///< May send to broadcast addresses.
  bool fragments{false};         ///< Allow IP fragments for datagrams above the MTU.
  bool reports_refusals{false};  ///< `next_refused` reports closed ports.
  int send_buffer_bytes{0};      ///< 0: the system's. A smaller one only means earlier drops.
};

/// The UDP side of a protocol: one socket, read on the thread of the io_context, at most 64
/// datagrams in a row. An exception of the handler costs one datagram. Not called after `stop`.
class UdpServer final {
 public:
  struct Datagram {
    std::span<const std::byte> bytes;  ///< Live until the handler returns.
    Peer from;
    /// Our IPv4 address that it was sent to; for a broadcast that of the receiving interface.
    std::uint32_t to{};
  };
  using Handler = std::function<void(const Datagram&)>;

  /// @return Error with the remedy when the port cannot be bound
  [[nodiscard]] static Expected<UdpServer> open(boost::asio::io_context& io,
                                                const BindTarget& target,
                                                const UdpOptions& options);
  UdpServer(UdpServer&&) = default;
  UdpServer& operator=(UdpServer&&) = delete;
  ~UdpServer();

  void start(Handler handler);
  /// @param interface  IPv4 address of the interface for multicast; 0: the system chooses
  /// @return the system's error
  [[nodiscard]] std::error_code use_multicast(std::uint32_t interface, int ttl);
  /// Makes this machine, also its other programs, receive a group by an interface, if possible.
  void join(const Peer& group, std::uint32_t interface);
  /// @param from  our own address that it leaves from, as in Datagram; 0: the system chooses
  void send(std::span<const std::byte> bytes, const Peer& to, std::uint32_t from = 0);

  /// Datagrams for `send_batch`; their bytes live until then.
  [[nodiscard]] DatagramBatch& batch();
  void add(std::span<const std::byte> bytes, const Peer& to);
  void add_cut(std::span<const std::byte> bytes, std::size_t cut, const Peer& to);
  void send_batch();

  /// A peer whose port is closed (ICMP). @return nullopt: no more of them
  [[nodiscard]] std::optional<Peer> next_refused();
  void stop();
  [[nodiscard]] bool is_open() const;
  [[nodiscard]] std::uint16_t port() const;  ///< Also when it is closed.

 private:
  struct State;
  explicit UdpServer(std::shared_ptr<State> state);

  std::shared_ptr<State> state_;
};

}  // namespace fiducap::net
