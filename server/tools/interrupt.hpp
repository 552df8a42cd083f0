#pragma once

namespace fiducap {

/// From now on Ctrl-C and SIGTERM only set a mark; a second one ends the process as usual.
void catch_interrupt();
[[nodiscard]] bool interrupted();

}  // namespace fiducap
