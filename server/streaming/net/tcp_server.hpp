#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "base/log.hpp"
#include "base/time.hpp"
#include "streaming/net/tcp_session.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap::net {

struct TcpLimits {
  std::string_view protocol;  ///< For the log, e.g. `vicon`; a literal.
  int max_clients{64};
  int max_clients_per_address{0};  ///< 0: as many as there is room for.
  /// Section of the configuration with the limits, a literal; empty: nothing is logged.
  std::string_view section{};
};

/// The TCP side of a protocol: accepts sessions within the limits, ticks and removes them. An
/// exception of a session ends that session only.
///
/// When all places are taken, the address with the most loses its newest session to an address with
/// at least two fewer, or to the operator at the machine itself (`place_for`); else the oldest
/// session that may be replaced is closed. No callback is called after `stop`.
class TcpServer final {
 public:
  /// @return the session of this connection; nullptr: refused
  using MakeSession = std::function<std::shared_ptr<Session>(Socket, const Peer&)>;
  /// Outgoing connections being established, in total and per address.
  static constexpr std::size_t kMaxConnecting = 32;
  static constexpr std::size_t kMaxConnectingPerAddress = 16;

  /// @param clock  lives until the io_context has run out of handlers
  TcpServer(boost::asio::io_context& io, const TcpLimits& limits, const Clock& clock);
  ~TcpServer() { stop(); }
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

  /// One more port. @return its number; Error with the remedy when it cannot be bound
  [[nodiscard]] Expected<std::uint16_t> listen(const BindTarget& target, MakeSession make);
  /// Releases all ports.
  void close_listeners();
  /// Connects to a peer, within the limits; does nothing when it is already connecting. Beyond
  /// kMaxConnecting the oldest attempt is given up.
  void connect(const Peer& peer, Duration timeout, MakeSession make);
  /// Ticks all sessions, then calls `ticked`, ten times a second.
  void start(std::function<void(Instant)> ticked = {});

  /// All open sessions. @tparam S  the type that `MakeSession` makes
  template <typename S, typename Work>
  void each(Work&& work) const {
    for (const auto& session : sessions()) {
      if (session->closed()) continue;
      const auto whose = [&] { return "client " + text_of(session->peer()); };
      if (!log::guarded(limits().protocol, whose, [&] { work(static_cast<S&>(*session)); }))
        session->close("is closed after a failure", log::Level::kWarning);
    }
  }

  /// No new sessions and ticks; sessions are closed after `delay`, for slow clients.
  void stop(Duration delay = Duration{0});

 private:
  struct State;
  [[nodiscard]] const std::vector<std::shared_ptr<Session>>& sessions() const;
  [[nodiscard]] const TcpLimits& limits() const;

  std::shared_ptr<State> state_;
};

}  // namespace fiducap::net
