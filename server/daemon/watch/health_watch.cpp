#include "daemon/watch/health_watch.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <utility>

#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/timex.h>
#include <sys/un.h>

#include "base/log.hpp"
#include "base/process.hpp"
#include "base/text.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {

constexpr double kRateFor_s = 2;
constexpr double kMissedShare = 0.02;
constexpr double kFullShare = 0.9;

// Cameras of robots give ten images a second and more; DDS and drivers need a moment to start.
constexpr double kSilent_s = 2;
constexpr double kSilentAtStart_s = 5;
// A control loop over poses tolerates less than this; single busy seconds are not reported.
constexpr double kLate_s = 0.15;
constexpr double kLateFor_s = 2;
constexpr double kSkippedShare = 0.25;
constexpr double kShareFor_s = 2;
constexpr double kCarriedFor_s = 2;
constexpr double kSearchingFor_s = 10;
// Of the time in which a thread waited for a core. Servers that keep up have less than half of it.
constexpr double kBusyShare = 0.8;

std::string milliseconds(double seconds) {
  return std::to_string(static_cast<int>(seconds * 1e3)) + " ms";
}

/// `some avg10=12.34 avg60=…`: the kernel's pressure stall information.
double read_waiting_share() {
  std::ifstream file("/proc/pressure/cpu");
  std::string some, newest;
  constexpr std::string_view kNewest = "avg10=";
  if (!(file >> some >> newest) || !newest.starts_with(kNewest)) return 0;
  return std::strtod(newest.c_str() + kNewest.size(), nullptr) / 100;
}

double since(std::int64_t ns, Instant now) { return to_seconds(now - instant_from_ns(ns)); }

}  // namespace

MachineState read_machine_state() {
  MachineState state;
  timex clock{};
  // A sandbox may forbid the call.
  const int answer = ::adjtimex(&clock);
  if (answer >= 0) state.clock_synchronised = answer != TIME_ERROR;
  state.waiting_share = read_waiting_share();
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) state.most_descriptors = limit.rlim_cur;
  state.open_descriptors = open_descriptors().size();
  return state;
}

void MachineHealth::look(const MachineState& state, Instant now) {
  if (!counted_at_ && !state.clock_synchronised) {  // at the first look
    events_.report({.severity = Severity::kInfo,
                    .subject = "clock",
                    .kind = "unknown",
                    .text = "it is not known whether this computer's clock is synchronised; stamps "
                            "in UTC (ROS 2, NatNet) depend on it",
                    .remedy = "Check with timedatectl"});
  }
  events_.set(state.clock_synchronised == false,
              {.severity = Severity::kInfo,
               .subject = "clock",
               .kind = "unsynchronised",
               .text = "this computer's clock is not synchronised: stamps in UTC (ROS 2, NatNet) "
                       "drift against other computers",
               .remedy = "timedatectl set-ntp true, chrony or PTP"},
              "this computer's clock is synchronised");
  const double full = state.most_descriptors == 0 ? 0
                                                  : static_cast<double>(state.open_descriptors) /
                                                        static_cast<double>(state.most_descriptors);
  events_.set(full > kFullShare,
              {.severity = Severity::kError,
               .subject = "server",
               .kind = "descriptors",
               .text = std::to_string(state.open_descriptors) + " of " +
                       std::to_string(state.most_descriptors) +
                       " files and sockets are open: new clients are rejected",
               .remedy = "See on the page which clients hold them, or raise LimitNOFILE"},
              "files and sockets are available again");
  judge_rate(state, now);
}

void MachineHealth::judge_rate(const MachineState& state, Instant now) {
  if (counted_at_ && to_seconds(now - *counted_at_) < kRateFor_s) return;
  const auto since = [](std::uint64_t before, std::uint64_t count) {
    return std::max(0.0, static_cast<double>(count) - static_cast<double>(before));
  };
  const double ticks = since(counted_.missed, state.missed);
  const double all = since(counted_.frames, state.frames) + ticks;
  const double missed = ticks + since(counted_.replaced, state.replaced);
  const bool counted = counted_at_ && all > 0;
  counted_ = state;
  counted_at_ = now;
  events_.set(counted && missed > kMissedShare * all,
              {.severity = Severity::kWarning,
               .subject = "server",
               .kind = "overload",
               .text = "frames are left out (" +
                       std::to_string(static_cast<int>(counted ? 100 * missed / all : 0)) +
                       " %): this computer is too busy for the rate",
               .remedy = "End other programs, lower streaming.rate_hz, or grant real-time "
                         "scheduling (LimitRTPRIO, see deploy/fiducapd.service)"},
              "all frames are sent again");
}

void BodyHealth::look(const BodyPose* pose, double waiting_share, Instant now) {
  if (!watched_since_) watched_since_ = now;
  const bool is_busy = waiting_share > kBusyShare;
  judge_source(is_busy, now);
  judge_lateness(is_busy && is_silent(pulse_.image_came_ns, now), now);
  if (pose != nullptr) return judge_pose(*pose, now);
  untracked_since_.reset();
  events_.end(name_, "tracking", "is not streamed any more");
}

/// Reports silent cameras singly, or all at once. On a busy computer the silence is no fault of
/// them, see judge_lateness.
void BodyHealth::judge_source(bool is_busy, Instant now) {
  judge_silence(pulse_.image_came_ns, "silent", "its camera", is_busy, now);
  const bool some_come = since(pulse_.image_came_ns, now) <= kSilent_s;
  for (std::size_t k = 0; cameras_ > 1 && k < std::min<std::size_t>(cameras_, kMostCameras); ++k) {
    const std::int64_t came = some_come ? pulse_.camera_came_ns[k].load() : to_ns(now);
    judge_silence(came, "silent_" + std::to_string(k), "its camera " + std::to_string(k), is_busy,
                  now);
  }
}

void BodyHealth::judge_silence(std::int64_t came, const std::string& kind,
                               const std::string& camera, bool is_busy, Instant now) {
  const bool silent = is_silent(came, now);
  events_.set(silent && !is_busy,
              event(Severity::kWarning, kind,
                    came == 0 ? "no image so far from " + camera : "no more images from " + camera,
                    remedies_.when_silent),
              pulse_.ended ? "its source has ended"
              : silent     ? "this computer is too busy to read images"
                           : "images come again");
}

bool BodyHealth::is_silent(std::int64_t came, Instant now) const {
  const double waited_s = came == 0 ? to_seconds(now - *watched_since_) : since(came, now);
  return !pulse_.ended && waited_s > (came == 0 ? kSilentAtStart_s : kSilent_s);
}

/// @param is_starved  no images come on a busy computer
void BodyHealth::judge_lateness(bool is_starved, Instant now) {
  if (!counted_at_ || to_seconds(now - *counted_at_) >= kShareFor_s) {
    const std::uint64_t images = pulse_.images, skipped = pulse_.skipped;
    const std::uint64_t came = images - images_;
    // More images may be skipped than came: they waited before.
    skipped_share_ =
        counted_at_ && came > 0
            ? std::min(1.0, static_cast<double>(skipped - skipped_) / static_cast<double>(came))
            : 0;
    images_ = images;
    skipped_ = skipped;
    counted_at_ = now;
  }
  const double late_s = static_cast<double>(pulse_.lateness_ns) * 1e-9;
  const double on_the_way_s = static_cast<double>(pulse_.on_the_way_ns) * 1e-9;
  const bool fresh = since(pulse_.image_came_ns, now) < kSilent_s;
  const auto when_over = [fresh](const char* text) {
    return fresh ? text : "no images come any more";
  };
  const bool too_late = seconds_since(late_since_, fresh && late_s > kLate_s, now) >= kLateFor_s;
  const bool by_source = too_late && on_the_way_s > late_s / 2;
  events_.set(by_source,
              event(Severity::kWarning, "source_late",
                    "its images are " + milliseconds(on_the_way_s) + " old when they arrive",
                    "Check the network, the driver's queues and the clocks of both computers"),
              when_over("images arrive in time again"));
  is_overloaded_ =
      is_starved || (too_late && !by_source) || (fresh && skipped_share_ > kSkippedShare);
  const std::string what = is_starved ? "no images are read"
                                      : std::to_string(static_cast<int>(skipped_share_ * 100)) +
                                            " % of the images are left out, poses are " +
                                            milliseconds(late_s) + " behind";
  events_.set(is_overloaded_,
              event(Severity::kWarning, "overload", "this computer does not keep up: " + what,
                    remedies_.when_busy),
              when_over("this computer keeps up again"));
}

void BodyHealth::judge_pose(const BodyPose& pose, Instant now) {
  const bool tracked = pose.state == BodyState::kTracking;
  was_tracked_ |= tracked;
  const double untracked_s = seconds_since(untracked_since_, !tracked, now);
  if (tracked) return events_.end(name_, "tracking", "is tracked again");
  if (pose.state == BodyState::kLost) {
    events_.begin(lost(now));
  } else if (was_tracked_ && untracked_s > kCarriedFor_s) {
    events_.begin(unseen(Severity::kWarning,
                         "sees no usable tag; its pose is predicted and grows uncertain",
                         "Let its camera see a tag of the map"));
  } else if (untracked_s > kSearchingFor_s) {
    const std::string text = "has found no pose for " + fixed(kSearchingFor_s, 0) + " s";
    events_.begin(is_overloaded_
                      ? event(Severity::kWarning, "tracking",
                              text + ": this computer uses too few of its images",
                              remedies_.when_busy)
                      : unseen(Severity::kWarning, text,
                               "Let its camera see a tag of the map; are family and size of the "
                               "tags as configured?"));
  }
}

Event BodyHealth::lost(Instant now) const {
  if (pulse_.ended) return event(Severity::kError, "tracking", "is lost: its source has ended", "");
  if (since(pulse_.image_came_ns, now) > kSilent_s)
    return event(Severity::kError, "tracking", "is lost: it gets no images",
                 "Check its camera; see also the messages of its source");
  return unseen(Severity::kError, "is lost: no tag was used for too long",
                "Let its camera see a tag of the map");
}

Event BodyHealth::unseen(Severity severity, std::string text, std::string remedy) const {
  if (const std::string why = pulse_.unseen.why(); !why.empty()) {
    text += ". No tag is found: " + why;
    remedy.clear();
  }
  return event(severity, "tracking", std::move(text), std::move(remedy));
}

double BodyHealth::seconds_since(std::optional<Instant>& begin, bool holds, Instant now) const {
  if (!holds) {
    begin.reset();
    return 0;
  }
  if (!begin) begin = now;
  return to_seconds(now - *begin);
}

Event BodyHealth::event(Severity severity, std::string kind, std::string text,
                        std::string remedy) const {
  return {.severity = severity,
          .subject = name_,
          .kind = std::move(kind),
          .text = std::move(text),
          .remedy = std::move(remedy)};
}

bool notify_service_manager(std::string_view state) {
  const char* path = std::getenv("NOTIFY_SOCKET");
  sockaddr_un to{};
  const std::size_t length = path == nullptr ? 0 : std::strlen(path);
  if (length < 2 || length >= sizeof(to.sun_path)) return false;
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, path, length);
  if (to.sun_path[0] == '@') to.sun_path[0] = '\0';  // in the abstract namespace
  const Descriptor socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  const auto sent = ::sendto(socket.number(), state.data(), state.size(), MSG_NOSIGNAL,
                             reinterpret_cast<const sockaddr*>(&to), size);
  return sent == static_cast<ssize_t>(state.size());
}

HealthWatch::HealthWatch(EventBoard& events, const Publisher& publisher, const Clock& clock,
                         std::function<void()> give_up)
    : events_(events),
      publisher_(publisher),
      clock_(clock),
      give_up_(std::move(give_up)),
      machine_(events) {}

void HealthWatch::add(int body_id, std::string name, std::size_t cameras, ImageRemedies remedies,
                      const BodyPulse& pulse) {
  bodies_.push_back({body_id, {std::move(name), cameras, std::move(remedies), pulse, events_}});
}

void HealthWatch::delivered(const std::shared_ptr<const SceneFrame>& frame) {
  ++delivered_;
  std::shared_ptr<const SceneFrame> old = frame;
  // Never waits for the watch: it can use the next frame.
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (lock) newest_.swap(old);
}

void HealthWatch::run(std::stop_token stop) {
  notify_service_manager("READY=1");
  while (clock_.wait_until(clock_.now() + kLook, stop))
    log::guarded(
        "watch", [] { return "a look at the server's health"; }, [this] { look(); });
  notify_service_manager("STOPPING=1");
}

/// Also without memory for the event, which may be the reason.
void HealthWatch::give_up() {
  log::guarded(
      "watch", [] { return "the report of a stall"; },
      [this] {
        events_.begin({.severity = Severity::kError,
                       .subject = "server",
                       .kind = "stalled",
                       .text = "no frame was delivered for ten seconds",
                       .remedy = "The process ends, so that it can be started again"});
      });
  if (give_up_) give_up_();
  gave_up_ = true;
}

void HealthWatch::look() {
  const auto verdict = frames_.look(delivered_);
  if (verdict == FrameWatchdog::Verdict::kFlows) notify_service_manager("WATCHDOG=1");
  if (verdict == FrameWatchdog::Verdict::kDead && !gave_up_) give_up();
  std::shared_ptr<const SceneFrame> frame;
  {
    const std::lock_guard lock(mutex_);
    frame = newest_;
  }
  const Instant now = clock_.now();
  MachineState machine = read_machine_state();
  for (Body& body : bodies_) {
    const BodyPose* pose = nullptr;
    if (frame) {
      const auto found = std::ranges::find(frame->bodies, body.id, &BodyPose::body_id);
      if (found != frame->bodies.end()) pose = &*found;
    }
    body.health.look(pose, machine.waiting_share, now);
  }
  const std::uint64_t delivered = delivered_;
  machine.frames = publisher_.frames();
  machine.missed = publisher_.missed();
  machine.replaced = machine.frames - std::min(machine.frames, delivered);
  machine_.look(machine, now);
  if (also_) also_();
  events_.settle(now);
}

}  // namespace fiducap
