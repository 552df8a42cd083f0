#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>

#include "base/expected.hpp"
#include "streaming/net/bind.hpp"

namespace fiducap::net {

/// Accepts TCP clients until it is stopped or destroyed, also after the machine ran out of
/// descriptors for a while.
class TcpListener final {
 public:
  using Accepted = std::function<void(boost::asio::ip::tcp::socket)>;

  /// @return Error with the remedy when the port cannot be had
  [[nodiscard]] static Expected<TcpListener> open(boost::asio::io_context& io,
                                                  const BindTarget& target, Accepted accepted);
  TcpListener(TcpListener&&) = default;
  TcpListener& operator=(TcpListener&&) = delete;
  ~TcpListener();

  /// Tries again after a failed accept; call now and then, e.g. ten times a second.
  void tick();
  void stop();
  [[nodiscard]] std::uint16_t port() const;

 private:
  struct State;
  explicit TcpListener(std::shared_ptr<State> state) : state_(std::move(state)) {}

  std::shared_ptr<State> state_;
};

}  // namespace fiducap::net
