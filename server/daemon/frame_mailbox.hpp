#pragma once

#include <functional>
#include <memory>

#include "scene/scene_frame.hpp"

namespace boost::asio {
class io_context;
}

namespace fiducap {

/// Hands the newest frame from the publisher's thread to one that does I/O. One place: a frame that
/// was not fetched in time is replaced, so that a busy I/O thread never works on old poses. Neither
/// thread ever waits for the other, whatever their priorities. Nothing is allocated per frame.
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

}  // namespace fiducap
