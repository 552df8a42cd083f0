#include "streaming/native/client_text.hpp"

#include <fmt/format.h>

namespace fiducap::native {

std::string text_of(const Subscriber& subscriber, const Profile& profile) {
  std::string text =
      (subscriber.name.empty() ? "unnamed" : subscriber.name) + ", " + text_of(profile);
  if (subscriber.multicast) text += ", multicast";
  if (subscriber.latency_p99 > Duration{0}) {
    text += fmt::format(", latency p99 {:.1f} ms", 1e3 * to_seconds(subscriber.latency_p99));
  }
  if (subscriber.lost_on_the_way > 0) {
    text += fmt::format(", reports {} frames lost on the way", subscriber.lost_on_the_way);
  }
  return text;
}

std::optional<ClockOffset> clock_of(const Subscriber& subscriber) {
  if (subscriber.clock_sigma <= Duration{0}) return std::nullopt;
  return ClockOffset{to_seconds(subscriber.clock_offset), to_seconds(subscriber.clock_sigma)};
}

}  // namespace fiducap::native
