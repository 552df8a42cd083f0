#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/event_board.hpp"
#include "base/time.hpp"
#include "daemon/bodies/body_reader.hpp"
#include "daemon/publisher.hpp"
#include "pipeline/body_pose.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

/// State of the machine at one instant.
struct MachineState {
  std::optional<bool> clock_synchronised;  ///< nullopt: not known.
  double waiting_share{0};                 ///< Of the last 10 s: a thread waited for a core.
  std::size_t open_descriptors{0};
  std::size_t most_descriptors{0};  ///< 0: not known.
  std::uint64_t frames{0};          ///< Published.
  std::uint64_t missed{0};          ///< Ticks of the publisher.
  /// Of `frames`: a newer one came before they were sent, because the I/O thread got no time.
  std::uint64_t replaced{0};
};

/// Reads the first four.
[[nodiscard]] MachineState read_machine_state();

/// Reports conditions of the computer.
class MachineHealth final {
 public:
  explicit MachineHealth(EventBoard& events) : events_(events) {}
  void look(const MachineState& state, Instant now);

 private:
  void judge_rate(const MachineState& state, Instant now);

  EventBoard& events_;
  MachineState counted_{};
  std::optional<Instant> counted_at_;
};

/// What to do about images of one kind of source.
struct ImageRemedies {
  std::string when_silent;  ///< None come.
  std::string when_busy{"End other programs, reduce the rate or size of images, or add cores"};
};

/// Reports conditions of one body: no images, images that are late or too many for this computer, a
/// coasting or lost pose. Called about twice a second. Not thread-safe.
class BodyHealth final {
 public:
  BodyHealth(std::string name, std::size_t cameras, ImageRemedies remedies, const BodyPulse& pulse,
             EventBoard& events)
      : name_(std::move(name)),
        cameras_(cameras),
        remedies_(std::move(remedies)),
        pulse_(pulse),
        events_(events) {}

  /// @param pose  of the newest frame; nullptr: the body is not streamed
  /// @param waiting_share  of the machine
  void look(const BodyPose* pose, double waiting_share, Instant now);

 private:
  void judge_source(bool is_busy, Instant now);
  void judge_silence(std::int64_t came_ns, const std::string& kind, const std::string& camera,
                     bool is_busy, Instant now);
  [[nodiscard]] bool is_silent(std::int64_t came_ns, Instant now) const;
  void judge_lateness(bool is_starved, Instant now);
  void judge_pose(const BodyPose& pose, Instant now);
  [[nodiscard]] Event lost(Instant now) const;
  /// With the reason why no tag is found where that is known, in place of the remedy.
  [[nodiscard]] Event unseen(Severity severity, std::string text, std::string remedy) const;
  [[nodiscard]] double seconds_since(std::optional<Instant>& begin, bool holds, Instant now) const;
  [[nodiscard]] Event event(Severity severity, std::string kind, std::string text,
                            std::string remedy) const;

  std::string name_;
  std::size_t cameras_;
  ImageRemedies remedies_;
  const BodyPulse& pulse_;
  EventBoard& events_;
  std::optional<Instant> watched_since_;
  std::optional<Instant> late_since_;
  std::optional<Instant> untracked_since_;
  std::uint64_t images_{0};  ///< At `counted_at_`.
  std::uint64_t skipped_{0};
  std::optional<Instant> counted_at_;
  double skipped_share_{0};
  bool is_overloaded_{false};
  bool was_tracked_{false};
};

/// Whether published frames reach the protocols. Counts looks, not time, so that a suspended
/// computer or a stopped process is not taken for a dead one.
class FrameWatchdog final {
 public:
  enum class Verdict {
    kFlows,
    kStalled,  ///< No frame since the last look.
    kDead,     ///< No frame for all granted looks.
  };

  explicit FrameWatchdog(int looks) : granted_(looks) {}

  /// @param delivered  total number of frames
  Verdict look(std::uint64_t delivered) {
    stalled_ = delivered == last_ ? stalled_ + 1 : 0;
    last_ = delivered;
    if (stalled_ == 0) return Verdict::kFlows;
    return stalled_ < granted_ ? Verdict::kStalled : Verdict::kDead;
  }

 private:
  int granted_;
  int stalled_{0};  ///< Looks without a new frame.
  std::uint64_t last_{0};
};

/// Notifies the service manager (systemd) of `READY=1`, `WATCHDOG=1`, `STOPPING=1`; see
/// sd_notify(3). Never waits.
/// @return false: there is none
bool notify_service_manager(std::string_view state);

/// Checks bodies, machine and frames twice a second, for the event board and the service manager. A
/// server whose frames are not delivered is given up, so that it is restarted.
class HealthWatch final {
 public:
  static constexpr Duration kLook = std::chrono::milliseconds(500);
  static constexpr int kMissedLooks = 20;

  /// @param give_up  called when no frame was delivered for ten seconds, until it has returned
  /// once; everything outlives this
  HealthWatch(EventBoard& events, const Publisher& publisher, const Clock& clock,
              std::function<void()> give_up);

  /// @param body_id  in the frames
  void add(int body_id, std::string name, std::size_t cameras, ImageRemedies remedies,
           const BodyPulse& pulse);
  /// Also called at each look.
  void also(std::function<void()> look) { also_ = std::move(look); }
  /// Every delivered frame. From the I/O thread; never waits.
  void delivered(const std::shared_ptr<const SceneFrame>& frame);
  /// Until stopped.
  void run(std::stop_token stop);
  void look();
  [[nodiscard]] std::uint64_t delivered() const { return delivered_; }

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
  std::function<void()> also_;
  std::vector<Body> bodies_;
  MachineHealth machine_;
  FrameWatchdog frames_{kMissedLooks};
  bool gave_up_{false};
  std::atomic<std::uint64_t> delivered_{0};
  std::mutex mutex_;
  std::shared_ptr<const SceneFrame> newest_;
};

}  // namespace fiducap
