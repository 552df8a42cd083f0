#pragma once

#include <string>

#include "streaming/native/profile.hpp"
#include "streaming/native/registry.hpp"

namespace fiducap::native {

/// What the page says about a client: name, profile, and what it reports of itself.
[[nodiscard]] std::string text_of(const Subscriber& subscriber, const Profile& profile);

}  // namespace fiducap::native
