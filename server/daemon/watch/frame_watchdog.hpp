#pragma once

#include <cstdint>

namespace fiducap {

/// Whether published frames still reach the protocols. Counts looks, not time: a computer that was
/// suspended, or a process that was stopped, is not taken for a dead one when it goes on.
class FrameWatchdog final {
 public:
  enum class Verdict {
    kFlows,
    kStands,  ///< No frame since the last look.
    kDead,    ///< … and so for as many looks as were granted.
  };

  explicit FrameWatchdog(int looks) : granted_(looks) {}

  /// @param delivered  frames, all told
  Verdict look(std::uint64_t delivered) {
    if (delivered != last_) {
      last_ = delivered;
      in_vain_ = 0;
      return Verdict::kFlows;
    }
    return ++in_vain_ < granted_ ? Verdict::kStands : Verdict::kDead;
  }

 private:
  int granted_;
  int in_vain_{0};
  std::uint64_t last_{0};
};

}  // namespace fiducap
