#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "scene/scene_frame.hpp"
#include "streaming/stream_hub.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap {

/// An event loop and the protocols that live in it. The newest frame comes in from the publisher;
/// whatever a handler throws, the others go on.
class StreamLoop final {
 public:
  using Delivered = std::function<void(const std::shared_ptr<const SceneFrame>&)>;

  /// @param name  for the log; a literal
  explicit StreamLoop(std::string_view name);
  ~StreamLoop();
  StreamLoop(const StreamLoop&) = delete;
  StreamLoop& operator=(const StreamLoop&) = delete;

  [[nodiscard]] boost::asio::io_context& io();
  [[nodiscard]] StreamHub& hub();
  /// @param delivered  called after the protocols have got a frame, on the loop's thread
  void on_delivered(Delivered delivered);

  /// From the publisher's thread; never waits.
  void put(std::shared_ptr<const SceneFrame> frame);
  /// Serves until `stop`, on the calling thread.
  void run();
  /// From any thread. The protocols say goodbye, a moment later `run` returns; called again, at
  /// once.
  void stop() noexcept;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fiducap
