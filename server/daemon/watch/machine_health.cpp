#include "daemon/watch/machine_health.hpp"

#include <sys/resource.h>
#include <sys/timex.h>

#include <algorithm>
#include <string>
#include <utility>

#include "base/open_descriptors.hpp"

namespace fiducap {

namespace {

constexpr double kRateFor_s = 2;
constexpr double kMissedShare = 0.02;
constexpr double kFullShare = 0.9;

}  // namespace

MachineState read_machine_state() {
  MachineState state;
  timex clock{};
  // A sandbox may refuse the question.
  const int answer = ::adjtimex(&clock);
  if (answer >= 0) state.clock_synchronised = answer != TIME_ERROR;
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) state.most_descriptors = limit.rlim_cur;
  state.open_descriptors = open_descriptors().size();
  return state;
}

void MachineHealth::look(const MachineState& state, Instant now) {
  if (!state.clock_synchronised && !std::exchange(said_unknown_clock_, true)) {
    events_.tell({.severity = Severity::kInfo,
                  .subject = "clock",
                  .kind = "unknown",
                  .text = "whether this computer's clock is synchronised may not be asked here; "
                          "stamps in UTC (ROS 2, NatNet) are worth what it is",
                  .remedy = "timedatectl says"});
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
                       " files and sockets are open: new clients are turned away",
               .remedy = "See on the page who holds so many; or raise LimitNOFILE"},
              "there is room for files and sockets again");
  judge_rate(state, now);
}

void MachineHealth::judge_rate(const MachineState& state, Instant now) {
  if (counted_at_ && to_seconds(now - *counted_at_) < kRateFor_s) return;
  const auto missed = static_cast<double>(state.missed - counted_.missed);
  const double all = static_cast<double>(state.frames - counted_.frames) + missed;
  const bool counted = counted_at_ && all > 0;
  counted_ = state;
  counted_at_ = now;
  events_.set(counted && missed > kMissedShare * all,
              {.severity = Severity::kWarning,
               .subject = "server",
               .kind = "overload",
               .text = "frames are left out (" +
                       std::to_string(static_cast<int>(counted ? 100 * missed / all : 0)) +
                       " %): this computer is too busy to keep the rate",
               .remedy = "End other programs, lower streaming.rate_hz, or grant real-time "
                         "scheduling (LimitRTPRIO, see deploy/fiducapd.service)"},
              "all frames are sent again");
}

}  // namespace fiducap
