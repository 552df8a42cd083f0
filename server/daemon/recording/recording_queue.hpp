#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <memory>
#include <variant>

#include "capture/sensor_source.hpp"
#include "daemon/recording/recorded_session.hpp"
#include "daemon/recording/session_files.hpp"

namespace fiducap {

struct SessionBegin {
  SessionStart start;
};
struct SessionEnd {};
using RecordedThing = std::variant<SessionBegin, SessionEnd, SensorSample, MapTurn, RefinementTurn>;

struct RecordedItem {
  std::shared_ptr<RecordedSession> session;
  std::size_t body{};
  RecordedThing what;
  std::size_t bytes{0};  ///< The queue's.
};

/// What waits for the disk, bounded by the memory that it holds: images and corners together
/// kImages_bytes, everything kMost_bytes. So IMU readings and turns, which are small and without
/// which the rest is of no use, go on for minutes after the first image was dropped. Dropped is
/// what comes; what waits already is kept.
///
/// `put` and `take_all` need the owner's lock, `written` none.
class RecordingQueue final {
 public:
  /// Nine seconds of one camera of 752 × 480 pixels at 60 Hz: longer than disks pause. Computers
  /// that run a server have four times as much, and more.
  static constexpr std::size_t kMost_bytes = std::size_t{256} << 20;
  static constexpr std::size_t kImages_bytes = std::size_t{192} << 20;

  /// Begin and end of a session always fit.
  /// @return false: dropped
  [[nodiscard]] bool put(RecordedItem item);
  /// Everything, in order. It counts until it is `written`.
  void take_all(std::deque<RecordedItem>& out);
  void written(const RecordedItem& item) { bytes_ -= item.bytes; }

  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  std::deque<RecordedItem> waiting_;
  std::atomic<std::size_t> bytes_{0};
};

}  // namespace fiducap
