#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/vrpn/session.hpp"

namespace fiducap::vrpn {

/// Takes connection requests by UDP and connects to who asks.
///
/// Only to the datagram's own source, whatever address its text names: nobody can make us connect
/// to a third party. Clients repeat themselves; a second connection would never be accepted, so one
/// that is under way or served is not asked for again.
class ConnectBack final : public std::enable_shared_from_this<ConnectBack> {
 public:
  using tcp = boost::asio::ip::tcp;
  using udp = boost::asio::ip::udp;
  static constexpr Duration kConnectTime = std::chrono::seconds(3);
  static constexpr int kMaxPending = 32;
  static constexpr int kMaxPendingPerSource = 16;

  struct Owner {
    std::function<bool(const tcp::endpoint&)> wants;  ///< Not served yet, and there is room.
    std::function<void(tcp::socket)> connected;
  };

  ConnectBack(boost::asio::io_context& io, udp::socket requests,
              std::shared_ptr<SessionContext> context, Owner owner);
  void start() { receive(); }
  /// Judges time limits, receives again after a failure; call now and then.
  void tick(Instant now);
  void stop();
  [[nodiscard]] std::size_t pending() const { return pending_.size(); }

 private:
  struct Pending {
    tcp::endpoint client;
    tcp::socket socket;
    Instant since;
  };
  void receive();
  void serve(std::size_t size);
  void connect(const tcp::endpoint& client);
  void done(const std::shared_ptr<Pending>& attempt);

  boost::asio::io_context& io_;
  udp::socket requests_;
  std::shared_ptr<SessionContext> context_;
  Owner owner_;
  udp::endpoint requester_;
  std::array<std::byte, 200> request_{};
  bool receiving_{false};
  bool stopped_{false};
  std::vector<std::shared_ptr<Pending>> pending_;
};

}  // namespace fiducap::vrpn
