#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "base/clock.hpp"
#include "base/expected.hpp"
#include "streaming/net/guard.hpp"
#include "streaming/net/tcp_session.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::net {

struct TcpLimits {
  std::string_view protocol;  ///< For the log, e.g. `vicon`; a literal.
  int max_clients{64};
  int max_clients_per_address{0};  ///< 0: as many as there is room for.
  /// Section of the configuration that has the limits, a literal; empty: nobody is told.
  std::string_view section{};
};

/// The TCP side of a protocol: listens, takes in sessions within the limits, ticks and forgets
/// them. What a session throws ends that session; accepting and ticking go on.
///
/// Nobody keeps others out by holding many places: when all are taken, the address with the most
/// loses its newest session to an address that has at least two fewer, and to the operator at the
/// machine itself (`place_for`). When nobody holds more than others, the oldest session that may be
/// replaced goes.
///
/// Nothing of it is called after `stop`, whatever still waits in the I/O queue.
class TcpServer final {
 public:
  /// @return the session of this connection; nullptr: refused
  using MakeSession = std::function<std::shared_ptr<Session>(Socket, const Peer&)>;
  /// Connections of our own under way, in all and to one address.
  static constexpr std::size_t kMaxConnecting = 32;
  static constexpr std::size_t kMaxConnectingPerAddress = 16;

  /// @param clock  lives until the io_context has run out of handlers
  TcpServer(boost::asio::io_context& io, const TcpLimits& limits, const Clock& clock);
  ~TcpServer() { stop(); }
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

  /// One more port. @return the one it got; Error with the remedy when it cannot be had
  [[nodiscard]] Expected<std::uint16_t> listen(const BindTarget& target, MakeSession make);
  /// Gives all ports back, so that others can be tried.
  void close_listeners();
  /// Connects to a peer, as if it had connected to us: within the limits, and once. Nothing
  /// happens when a connection to it is under way. When too many are, the oldest is given up.
  void connect(const Peer& peer, Duration patience, MakeSession make);
  /// Ticks all sessions ten times a second, and then `ticked`.
  void start(std::function<void(Instant)> ticked = {});

  /// All sessions that are not closed. @tparam S  what the server's `MakeSession` makes
  template <typename S, typename Work>
  void each(Work&& work) const {
    for (const auto& session : sessions()) {
      if (session->closed()) continue;
      const auto whose = [&] { return "client " + text_of(session->peer()); };
      if (!guarded(limits().protocol, whose, [&] { work(static_cast<S&>(*session)); }))
        session->close("is closed after a failure", log::Level::kWarning);
    }
  }

  /// No new sessions and no more ticks; the sessions end when `goodbye` is over, so that clients
  /// whose socket is full may still read what was sent last.
  void stop(Duration goodbye = Duration{0});

 private:
  struct State;
  [[nodiscard]] const std::vector<std::shared_ptr<Session>>& sessions() const;
  [[nodiscard]] const TcpLimits& limits() const;

  std::shared_ptr<State> state_;
};

}  // namespace fiducap::net
