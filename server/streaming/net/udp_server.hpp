#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>

#include "base/expected.hpp"
#include "streaming/net/datagram_batch.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::net {

struct UdpOptions {
  std::string_view protocol;     ///< For the log, e.g. `natnet`; a literal.
  std::size_t longest{2048};     ///< Bytes taken of a datagram; a longer one is cut.
  bool shared{false};            ///< Other sockets of this machine may hear the same broadcasts.
  bool fragments{false};         ///< Datagrams above the MTU go in IP fragments.
  bool reports_refusals{false};  ///< `next_refused` tells of closed ports.
  int send_buffer_bytes{0};      ///< 0: the system's. A smaller one only means earlier drops.
};

/// The UDP side of a protocol: one socket, read on the thread of the io_context, at most 64
/// datagrams before other work gets its turn. What a handler throws costs that datagram and no
/// other.
///
/// The handler is not called after `stop`, whatever still waits in the I/O queue.
class UdpServer final {
 public:
  struct Datagram {
    std::span<const std::byte> bytes;  ///< Live until the handler returns.
    Peer from;
    /// Our IPv4 address that it was sent to; for a broadcast that of the interface it came in on.
    std::uint32_t to{};
  };
  using Handler = std::function<void(const Datagram&)>;

  /// @return Error with the remedy when the port cannot be had
  [[nodiscard]] static Expected<UdpServer> open(boost::asio::io_context& io,
                                                const BindTarget& target,
                                                const UdpOptions& options);
  UdpServer(UdpServer&&) = default;
  UdpServer& operator=(UdpServer&&) = delete;
  ~UdpServer();

  void start(Handler handler);
  /// @param interface  IPv4 address of the card that multicast leaves by; 0: the system chooses
  /// @return what the system says when it cannot
  [[nodiscard]] std::error_code use_multicast(std::uint32_t interface, int ttl);
  /// Takes in what comes to a group by a card, in the name of this machine: sockets of others that
  /// are bound to its port hear it, too. A comfort; does nothing where it cannot.
  void join(const Peer& group, std::uint32_t interface);
  /// A datagram that the socket does not take is lost like any other.
  /// @param from  our own address that it leaves from, as in Datagram; 0: the system chooses
  void send(std::span<const std::byte> bytes, const Peer& to, std::uint32_t from = 0);

  /// Datagrams that leave together by `send_batch`; their bytes live until then.
  [[nodiscard]] DatagramBatch& batch();
  void add(std::span<const std::byte> bytes, const Peer& to);
  void add_cut(std::span<const std::byte> bytes, std::size_t cut, const Peer& to);
  void send_batch();

  /// A peer whose machine said that nobody listens at that port. @return nullopt: no more of them
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
