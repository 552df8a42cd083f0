#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

namespace fiducap::native {

/// Hears broadcasts for a server whose own socket is bound to one IPv4 address and therefore does
/// not.
class BroadcastEars final {
 public:
  using Heard =
      std::function<void(std::span<const std::byte>, const boost::asio::ip::udp::endpoint&)>;

  /// Nothing to hear on loopback, on IPv6 or on all addresses (the server's own socket hears
  /// broadcasts there); a broadcast address that cannot be bound is said in the log.
  BroadcastEars(boost::asio::io_context& io, const std::string& address, std::uint16_t port,
                Heard heard);
  ~BroadcastEars() { stop(); }
  BroadcastEars(const BroadcastEars&) = delete;
  BroadcastEars& operator=(const BroadcastEars&) = delete;
  void stop();

 private:
  struct Ear;
  std::vector<std::shared_ptr<Ear>> ears_;
};

}  // namespace fiducap::native
