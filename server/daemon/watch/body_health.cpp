#include "daemon/watch/body_health.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace fiducap {

namespace {

// Cameras of robots give ten images a second and more; DDS and drivers need a moment to start.
constexpr double kSilent_s = 2;
constexpr double kSilentAtStart_s = 5;
// A loop closed over poses feels more than this; a busy second alone is not worth a word.
constexpr double kLate_s = 0.15;
constexpr double kLateFor_s = 2;
constexpr double kSkippedShare = 0.25;
constexpr double kShareFor_s = 2;
constexpr double kCarriedFor_s = 2;
constexpr double kSearchingFor_s = 10;

std::string in_words(double seconds) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), seconds < 10 ? "%.1f s" : "%.0f s", seconds);
  return text.data();
}

std::string milliseconds(double seconds) {
  return std::to_string(static_cast<int>(seconds * 1e3)) + " ms";
}

double since(std::int64_t ns, Instant now) { return to_seconds(now - instant_from_ns(ns)); }

}  // namespace

void BodyHealth::look(const BodyPose* pose, Instant now) {
  if (!watched_since_) watched_since_ = now;
  judge_source(now);
  judge_lateness(now);
  if (pose != nullptr) return judge_pose(*pose, now);
  untracked_since_.reset();
  events_.end(name_, "tracking", "is not streamed any more");
}

/// Of several cameras each may fall silent; with none of them it is said of all at once.
void BodyHealth::judge_source(Instant now) {
  judge_silence(pulse_.image_came_ns, "silent", "its camera", now);
  const bool some_come = since(pulse_.image_came_ns, now) <= kSilent_s;
  for (std::size_t k = 0; cameras_ > 1 && k < std::min<std::size_t>(cameras_, kMostCameras); ++k) {
    const std::int64_t came = some_come ? pulse_.camera_came_ns[k].load() : to_ns(now);
    judge_silence(came, "silent_" + std::to_string(k), "its camera " + std::to_string(k), now);
  }
}

void BodyHealth::judge_silence(std::int64_t came, const std::string& kind,
                               const std::string& camera, Instant now) {
  const double waited_s = came == 0 ? to_seconds(now - *watched_since_) : since(came, now);
  const bool silent = !pulse_.ended && waited_s > (came == 0 ? kSilentAtStart_s : kSilent_s);
  events_.set(silent,
              event(Severity::kWarning, kind,
                    came == 0 ? "not one image has come from " + camera
                              : "no image has come from " + camera + " any more",
                    "Look at its cable, its driver and the name of its topic or device"),
              pulse_.ended ? "its source has ended" : "images come again");
}

void BodyHealth::judge_lateness(Instant now) {
  if (!counted_at_ || to_seconds(now - *counted_at_) >= kShareFor_s) {
    const std::uint64_t images = pulse_.images, skipped = pulse_.skipped;
    const std::uint64_t came = images - images_;
    // More may be left out than came: they waited from before.
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
                    "Look at the network, the driver's queues and the clocks of both computers"),
              when_over("images arrive in time again"));
  const bool busy = (too_late && !by_source) || (fresh && skipped_share_ > kSkippedShare);
  events_.set(
      busy,
      event(Severity::kWarning, "overload",
            "this computer does not keep up: " +
                std::to_string(static_cast<int>(skipped_share_ * 100)) +
                " % of its images are left out, poses are " + milliseconds(late_s) + " behind",
            "End other programs, give fewer or smaller images, or more cores"),
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
    events_.begin(event(Severity::kWarning, "tracking",
                        "sees no tag it can use, its pose is carried on and grows uncertain",
                        "Let its camera see a tag of the map"));
  } else if (untracked_s > kSearchingFor_s) {
    events_.begin(event(Severity::kWarning, "tracking",
                        "has not found its place for " + in_words(kSearchingFor_s),
                        "Let its camera see a tag of the map; are family and size of the tags as "
                        "configured?"));
  }
}

Event BodyHealth::lost(Instant now) const {
  if (pulse_.ended) return event(Severity::kError, "tracking", "is lost: its source has ended", "");
  if (since(pulse_.image_came_ns, now) > kSilent_s)
    return event(Severity::kError, "tracking", "is lost: it gets no images",
                 "Look at its camera; what the source says stands beside this");
  return event(Severity::kError, "tracking",
               "is lost: no tag was used for so long that its pose may not be used",
               "Let its camera see a tag of the map");
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

}  // namespace fiducap
