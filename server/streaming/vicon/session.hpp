#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "streaming/net/tcp_session.hpp"
#include "streaming/streamer.hpp"
#include "streaming/vicon/connection.hpp"
#include "streaming/vicon/frame_board.hpp"

namespace fiducap::vicon {

/// What the sessions of one server share. Lives as long as the last of their handlers.
struct SessionContext {
  const Clock& clock;
  FrameBoard board;
  ProfileTable profiles{};
};

/// One client's socket and conversation: gets the newest frame when it wants one.
class Session final : public net::TcpSession {
 public:
  /// From accept to greeting. SDK 1.12 asks for segments just after it has connected; a greeting
  /// that comes a little later finds that wish already made, so that the client's first frame has
  /// poses.
  static constexpr Duration kGreetingDelay = std::chrono::milliseconds(40);

  Session(net::Socket socket, std::shared_ptr<SessionContext> context);

  void start() override;
  /// The newest frame, unless this client does not want it.
  void publish();

  [[nodiscard]] bool open() const { return connection_.open(); }
  [[nodiscard]] ClientStatus status(Instant now) const;

 private:
  void received(std::span<const std::byte> bytes) override;
  void ticked(Instant now) override;
  void woken() override;

  std::shared_ptr<SessionContext> context_;
  Connection connection_;
  bool statics_in_last_frame_{false};
};

}  // namespace fiducap::vicon
