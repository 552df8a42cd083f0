#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "daemon/recording/recording_queue.hpp"

namespace fiducap {

inline constexpr const char* kRecorder = "recorder";  ///< Subject of events and log.

/// Carries out what waited in the queue: the only one that touches the disk of the recordings.
/// Flushes every second, so that a killed server loses no more. A session that fails is over; what
/// is on disk stays there.
class SessionWriter final {
 public:
  /// @param folder  the sessions' own are made in it
  /// @param bodies, clock, events  outlive the writer
  SessionWriter(std::filesystem::path folder, const std::vector<RecordedBody>& bodies,
                const Clock& clock, EventBoard& events)
      : folder_(std::move(folder)), bodies_(bodies), clock_(clock), events_(events) {}

  /// May wait for the disk. A failure is the session's, and said.
  void write(const RecordedItem& item) noexcept;
  void flush_when_due() noexcept;
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// A session's files are open.
  [[nodiscard]] bool is_open() const { return files_.has_value(); }

 private:
  [[nodiscard]] Expected<void> carry_out(const RecordedItem& item);
  [[nodiscard]] Expected<void> open(const std::shared_ptr<RecordedSession>& session,
                                    const SessionStart& start);
  [[nodiscard]] Expected<void> finish();
  void give_up(RecordedSession& session, const Error& why);

  std::filesystem::path folder_;
  const std::vector<RecordedBody>& bodies_;
  const Clock& clock_;
  EventBoard& events_;
  std::shared_ptr<RecordedSession> session_;  ///< Whose files are open.
  std::optional<SessionFiles> files_;
  std::uint64_t written_{0};  ///< Samples given to `files_`.
  Instant flushed_at_{};
  bool failing_{false};
};

}  // namespace fiducap
