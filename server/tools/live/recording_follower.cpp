#include "tools/live/recording_follower.hpp"

#include <algorithm>
#include <thread>

#include "base/text.hpp"

namespace fiducap {

namespace {

constexpr std::chrono::milliseconds kLook{50};

std::string size_text(std::uint64_t bytes) {
  const auto count = static_cast<double>(bytes);
  if (count >= 1e9) return fixed(count * 1e-9, 2) + " GB";
  if (count >= 1e6) return fixed(count * 1e-6, 1) + " MB";
  return fixed(count * 1e-3, 1) + " kB";
}

std::string quoted(const std::string& name) { return "the recording \"" + name + "\""; }

/// How patience ends.
Error tired(const Recording& recording, std::chrono::duration<double> patience) {
  const bool begins = recording.state == RecordingState::kStarting;
  return {ErrorCode::kUnavailable,
          quoted(recording.name) + (begins ? " has not begun" : " is still being written") +
              ": its disk has taken nothing for " + fixed(patience.count(), 1) +
              " s. What was measured waits in the server's memory; `fiducap control list` tells "
              "how it goes on (so far " +
              counts_of(recording) + ")",
          {}};
}

Error failure(const Recording& recording) {
  return {ErrorCode::kUnavailable,
          quoted(recording.name) + " has failed: " + recording.reason +
              "; saved: " + counts_of(recording),
          {}};
}

Expected<std::optional<Recording>> look_up(Control& control, const std::string& name) {
  ControlState state;
  if (const Outcome outcome = control.list(state); !outcome)
    return fail(ErrorCode::kUnavailable, outcome.problem);
  const auto& all = state.recordings;
  const auto newest = std::find_if(
      all.rbegin(), all.rend(), [&](const Recording& recording) { return recording.name == name; });
  return newest == all.rend() ? std::optional<Recording>{} : *newest;
}

}  // namespace

std::string counts_of(const Recording& recording) {
  return std::to_string(recording.samples) + " samples, " + size_text(recording.bytes) + "; " +
         std::to_string(recording.dropped) + " dropped";
}

std::string_view word_of(RecordingState state) {
  switch (state) {
    case RecordingState::kStarting:
      return "starting";
    case RecordingState::kRecording:
      return "recording";
    case RecordingState::kStopping:
      return "stopping";
    case RecordingState::kFinished:
      return "finished";
    case RecordingState::kFailed:
      return "failed";
  }
  return "unknown";
}

Expected<std::optional<Recording>> follow_recording(Control& control, const std::string& name,
                                                    RecordingState wanted,
                                                    std::chrono::duration<double> patience) {
  auto moved_at = std::chrono::steady_clock::now();
  std::uint64_t bytes = 0;
  for (;;) {
    auto now = look_up(control, name);
    if (!now || !*now) return now;
    const Recording& recording = **now;
    if (recording.state == RecordingState::kFailed) return tl::unexpected(failure(recording));
    if (recording.state >= wanted) return now;
    if (recording.bytes != bytes) moved_at = std::chrono::steady_clock::now();
    bytes = recording.bytes;
    if (std::chrono::steady_clock::now() - moved_at > patience)
      return tl::unexpected(tired(recording, patience));
    std::this_thread::sleep_for(kLook);
  }
}

}  // namespace fiducap
