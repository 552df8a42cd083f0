#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "scene/scene_frame.hpp"

namespace fiducap::vrpn {

/// Notices when a body stops or starts again to be tracked, and says so as a text message from that
/// body: poses just stop coming, and a user should learn why. Lost is a warning (clients print it),
/// found again is not (they stay silent). At most one message per second and body; what happened in
/// between is said by the next one.
class BodyWatch final {
 public:
  /// @param sender_of_body  in the order of frame.bodies; negative: not served.
  /// @param out  whole messages are appended, rarely any.
  void observe(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
               std::vector<std::byte>& out);

 private:
  struct Seen {
    bool ever{false};       ///< Valid once; a body that was never seen is not lost.
    bool said_valid{true};  ///< What clients were told last.
    std::optional<Instant> said_at;
  };
  std::vector<Seen> by_sender_;
};

}  // namespace fiducap::vrpn
