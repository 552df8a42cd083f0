#pragma once

#include <sys/types.h>

namespace fiducap {

/// The calling thread runs before those that only compute, so that a frame does not wait for a
/// filter or a detector when all cores are busy: round robin, and only this thread, not those that
/// it starts. The kernel stops it when it takes more than 95 % of a core.
/// @return false: no right to it (root, CAP_SYS_NICE, or RLIMIT_RTPRIO as in
/// deploy/fiducapd.service), nothing has changed
bool run_urgently();

/// The calling thread, and those that it starts, run where nobody else wants to: long work that
/// nobody waits for. The kernel looks upon its core as a free one. Nice values are not enough: with
/// 10 the bodies' 99 % latency is half as long again while a map is refined, with this it is not.
/// Where all cores are busy all the time it hardly gets on.
void run_patiently();
/// As run_patiently() where the thread may lose its patience later; else like any other, or hardly
/// less so (a nice value more).
void run_patiently_for_now();
/// A thread of this process that runs patiently runs like any other from now on.
/// @param thread  the kernel's number of it
/// @return false: no right to it (root, CAP_SYS_NICE, RLIMIT_NICE), or it has ended
bool lose_patience(pid_t thread);

}  // namespace fiducap
