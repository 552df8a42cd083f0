#pragma once

#include <string_view>

namespace fiducap {

/// Tells the service manager (systemd) that started this process how it is: `READY=1`,
/// `WATCHDOG=1`, `STOPPING=1`; see sd_notify(3). Does nothing when there is none. Never waits.
/// @return whether somebody was told
bool tell_service_manager(std::string_view state);

}  // namespace fiducap
