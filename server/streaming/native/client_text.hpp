#pragma once

#include <optional>
#include <string>

#include "streaming/native/profile.hpp"
#include "streaming/native/registry.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::native {

/// What the page says about a client: name, profile, and what it reports of itself.
[[nodiscard]] std::string text_of(const Subscriber& subscriber, const Profile& profile);
/// What it measured and reports; nothing: not yet.
[[nodiscard]] std::optional<ClockOffset> clock_of(const Subscriber& subscriber);

}  // namespace fiducap::native
