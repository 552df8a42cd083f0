#include "streaming/vrpn/body_watch.hpp"

#include <algorithm>
#include <chrono>

#include "streaming/vrpn/codec.hpp"

namespace fiducap::vrpn {

namespace {
constexpr Duration kQuietTime = std::chrono::seconds(1);
}

void BodyWatch::observe(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
                        std::vector<std::byte>& out) {
  const std::size_t count = std::min(frame.bodies.size(), sender_of_body.size());
  for (std::size_t i = 0; i < count; ++i) {
    if (sender_of_body[i] < 0) continue;
    const auto sender = static_cast<std::size_t>(sender_of_body[i]);
    if (sender >= by_sender_.size()) by_sender_.resize(sender + 1);
    Seen& seen = by_sender_[sender];
    const bool valid = frame.bodies[i].valid;
    seen.ever = seen.ever || valid;
    if (!seen.ever || valid == seen.said_valid) continue;
    if (seen.said_at && frame.at - *seen.said_at < kQuietTime) continue;
    seen.said_valid = valid;
    seen.said_at = frame.at;
    const Header header{frame.utc_ns(), sender_of_body[i], static_cast<std::int32_t>(Type::kText),
                        0};
    encode_text(header,
                valid ? TextMessage{Severity::kNormal, 0, "tracked again"}
                      : TextMessage{Severity::kWarning, 0,
                                    "not tracked any more: no reports until tags are seen again"},
                out);
  }
}

}  // namespace fiducap::vrpn
