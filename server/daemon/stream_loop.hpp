#pragma once

#include <atomic>
#include <csignal>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include "base/time.hpp"
#include "daemon/config/config_file.hpp"
#include "middleware/participant.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/net/repeated_wait.hpp"
#include "streaming/operator_api.hpp"
#include "streaming/page_api.hpp"
#include "streaming/streamer.hpp"

namespace fiducap {

/// Waits for SIGINT and SIGTERM on an io_context; survives exceptions of other handlers.
class SignalWait final : public net::RepeatedWait {
 public:
  /// @param stop  called at each signal; never throws
  SignalWait(boost::asio::io_context& io, std::function<void()> stop)
      : signals_(io, SIGINT, SIGTERM), stop_(std::move(stop)) {}

  void resume() override;
  /// Later signals end the process at once.
  void release();

 private:
  boost::asio::signal_set signals_;
  std::function<void()> stop_;
  net::PendingWait pending_;
};

/// Hands the newest frame from the publisher's thread to an I/O thread. It holds one frame, which a
/// newer one replaces, so that a busy I/O thread never gets old poses. No thread waits for the
/// other, at any priorities. Allocates nothing per frame.
class FrameMailbox final {
 public:
  using Receiver = std::function<void(const std::shared_ptr<const SceneFrame>&)>;

  /// @param receiver  called on the thread that runs `io`
  FrameMailbox(boost::asio::io_context& io, Receiver receiver);
  ~FrameMailbox();
  FrameMailbox(const FrameMailbox&) = delete;
  FrameMailbox& operator=(const FrameMailbox&) = delete;

  /// From one thread at a time; never waits.
  void put(std::shared_ptr<const SceneFrame> frame);
  /// On the I/O thread: no frame is delivered after this.
  void close();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

/// An event loop with its protocols, which publish the newest frame. An exception costs one
/// handler; the others continue.
class StreamLoop final {
 public:
  using Delivered = std::function<void(const std::shared_ptr<const SceneFrame>&)>;

  /// @param name  for the log; a literal
  explicit StreamLoop(std::string_view name);

  [[nodiscard]] boost::asio::io_context& io() { return io_; }
  [[nodiscard]] StreamHub& hub() { return hub_; }
  /// @param delivered  called after the protocols have got a frame, on the loop's thread
  void on_delivered(Delivered delivered) { delivered_ = std::move(delivered); }

  /// From the publisher's thread; never waits.
  void put(std::shared_ptr<const SceneFrame> frame) { mailbox_.put(std::move(frame)); }
  /// Serves until `stop`, on the calling thread.
  void run();
  /// From any thread. The protocols shut down and a moment later `run` returns; called again, at
  /// once.
  void stop() noexcept;

 private:
  void shut_down();

  std::string_view name_;
  boost::asio::io_context io_{1};
  // Keeps the loop running when an exception has removed the last wait.
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_{
      io_.get_executor()};
  boost::asio::steady_timer shutdown_timer_{io_};
  StreamHub hub_;
  FrameMailbox mailbox_;
  Delivered delivered_;
  std::atomic<bool> stopping_{false};
  bool is_shutting_down_{false};
};

/// What protocol servers need; everything outlives the two loops.
struct ProtocolParts {
  StreamLoop& frames;
  StreamLoop& pages;  ///< For protocols whose configuration has `kCanWait`.
  const ServerConfig& config;
  std::shared_ptr<const SceneModel> model;
  OperatorApi& operators;
  const EventBoard& events;
  const Clock& clock;
  std::function<Expected<std::shared_ptr<dds::Participant>>()> join_dds;
  CameraViews* views{};  ///< nullptr: no camera views.
  SetupApi* setup{};     ///< nullptr: no set-up.
};

/// Starts every enabled protocol in its loop. A failure is a warning with its remedy for protocols
/// of `streaming.optional`, else an error.
/// @return ports in use (a configured 0 is any free port); 0: not served
[[nodiscard]] Expected<ProtocolPorts> start_protocols(const ProtocolParts& parts);

}  // namespace fiducap
