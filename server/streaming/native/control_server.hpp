#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <boost/asio/io_context.hpp>

#include "base/clock.hpp"
#include "streaming/native/wrong_proofs.hpp"
#include "streaming/net/tcp_listener.hpp"
#include "streaming/operator_desk.hpp"

namespace fiducap::native {

/// The control channel: at most kMostClients connections, commands of who knows the operator's
/// token.
class ControlServer final {
 public:
  static constexpr std::size_t kMostClients = 16;
  static constexpr std::size_t kMostPerAddress = 4;

  /// @return Error with the remedy when the port cannot be had
  [[nodiscard]] static Expected<std::unique_ptr<ControlServer>> open(boost::asio::io_context& io,
                                                                     const net::BindTarget& target,
                                                                     OperatorDesk& desk,
                                                                     const Clock& clock);
  ~ControlServer();
  /// Ends who is silent for too long; call about ten times a second.
  void tick(Instant now);
  void stop();

 private:
  class Session;
  ControlServer(OperatorDesk& desk, const Clock& clock);
  void accept(boost::asio::ip::tcp::socket socket);

  OperatorDesk& desk_;
  const Clock& clock_;
  std::array<std::uint64_t, 2> hash_key_{};
  WrongProofs wrong_;
  std::unique_ptr<net::TcpListener> listener_;
  std::vector<std::shared_ptr<Session>> sessions_;
};

}  // namespace fiducap::native
