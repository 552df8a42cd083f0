#pragma once

#include <optional>
#include <string>

#include "estimation/body_estimate.hpp"

namespace fiducap {

/// Poses are only given once images and IMU have fitted together for a while.
///
/// In a new room, before cameras and gyro were ever seen to agree, axes may be wrong, a clock far
/// off, or the start on the wrong branch, and the first images fit all of that. There a single
/// image that contradicts makes everybody wait anew, for ten seconds at most. A room that is
/// known tells at once which way is up: there poses are given from the first image on. A body that
/// hardly turns never shows that its axes are right; while its images fit, it has poses. One that
/// had to be found anew, because images contradicted where it was, has them when they fit again;
/// one that did not know its place, and was told by one tag alone, when that tag has fitted for a
/// while.
class PoseTrust final {
 public:
  /// Every image.
  /// @param is_established  all cameras agree with the gyro
  /// @param is_room_known   tags in view are in the map, and not by this body alone
  void add(const UpdateReport& report, bool is_established, bool is_room_known);
  /// What images said until now was said at another time: they have to fit anew.
  void note_clock_jump();

  [[nodiscard]] bool withholds() const { return stage_ != Stage::kBelieved; }
  /// Only because too few images have come so far: nothing has contradicted.
  [[nodiscard]] bool is_untested() const {
    return stage_ == Stage::kNew || stage_ == Stage::kReturned;
  }
  /// Images have contradicted the IMU for so long that somebody has to hear of it. Once each time.
  [[nodiscard]] bool take_news();

 private:
  enum class Stage { kNew, kContradicted, kBelieved, kReturned };

  void forget_fits();
  void contradict();
  void believe();

  Stage stage_{Stage::kNew};
  unsigned last_{0};  ///< One bit per image with tags to use, the newest lowest: it contradicts.
  std::optional<Instant> first_image_;  ///< Of a new room.
  int fits_{0};                         ///< Images that fitted since the last contradiction …
  std::optional<Instant> first_fit_;    ///< … and the first of them.
  Instant now_{};
  Instant contradicted_since_{};
  bool is_told_{false};
  bool was_lost_{false};  ///< Found anew, or started again: agreement of the axes is not enough.
  int generation_{-1};
};

/// @param is_established  see PoseTrust::add
[[nodiscard]] std::string contradiction_text(bool is_established);

}  // namespace fiducap
