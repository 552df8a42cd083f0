#pragma once

namespace fiducap {

/// The calling thread runs before those that only compute, so that a frame does not wait for a
/// filter or a detector when all cores are busy: round robin, and only this thread, not those that
/// it starts. The kernel stops it when it takes more than 95 % of a core.
/// @return false: no right to it (root, CAP_SYS_NICE, or RLIMIT_RTPRIO as in
/// deploy/fiducapd.service), nothing has changed
bool run_urgently();

}  // namespace fiducap
