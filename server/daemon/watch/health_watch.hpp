#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <vector>

#include "base/clock.hpp"
#include "daemon/publisher.hpp"
#include "daemon/watch/body_health.hpp"
#include "daemon/watch/frame_watchdog.hpp"
#include "daemon/watch/machine_health.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// Looks twice a second whether bodies, machine and frames are well, and tells the event board and
/// the service manager. A server whose frames reach nobody any more is given up, so that it is
/// started again.
class HealthWatch final {
 public:
  static constexpr Duration kLook = std::chrono::milliseconds(500);
  static constexpr int kLooksInVain = 20;

  /// @param give_up  called when no frame was delivered for ten seconds, until it has returned
  /// once; everything outlives this
  HealthWatch(EventBoard& events, const Publisher& publisher, const Clock& clock,
              std::function<void()> give_up);

  /// @param body_id  in the frames
  void add(int body_id, std::string name, std::size_t cameras, const BodyPulse& pulse);
  /// Every frame, when the protocols have it. From the I/O thread; never waits.
  void delivered(const std::shared_ptr<const SceneFrame>& frame);
  /// Until stopped.
  void run(std::stop_token stop);
  void look();

 private:
  void give_up();

  struct Body {
    int id;
    BodyHealth health;
  };

  EventBoard& events_;
  const Publisher& publisher_;
  const Clock& clock_;
  std::function<void()> give_up_;
  std::vector<Body> bodies_;
  MachineHealth machine_;
  FrameWatchdog frames_{kLooksInVain};
  bool gave_up_{false};
  std::atomic<std::uint64_t> delivered_{0};
  std::mutex mutex_;
  std::shared_ptr<const SceneFrame> newest_;
};

}  // namespace fiducap
