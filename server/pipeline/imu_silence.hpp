#pragma once

#include <optional>
#include <string_view>

#include "base/time.hpp"

namespace fiducap {

/// Whether a body that should have an IMU has readings up to its images, and, if not, whether the
/// IMU is silent or its readings come and are all older: then one of the clocks is wrong.
class ImuSilence final {
 public:
  /// As samples come, whatever their order. @param stamp  the device's
  void image_came(Instant stamp) { newest_image_ = stamp; }
  void reading_came(Instant sampled_at);

  /// As samples are used, in order.
  void reading_used(Instant sampled_at) { used_at_ = sampled_at; }
  void image_used(Instant exposed_at, Instant stamp);

  [[nodiscard]] bool is_silent() const { return is_silent_; }
  /// What images say of the present is of another time: no pose may be believed.
  [[nodiscard]] bool lags() const { return lags_; }
  /// That it has become silent, or come back; once. Empty: nothing has changed.
  [[nodiscard]] std::string_view take_news();

 private:
  /// By how much readings were older than the newest image when they came, at least.
  struct Lag {
    Instant since{};
    Duration least{Duration::max()};
  };

  std::optional<Instant> newest_image_;  ///< As stamped.
  std::optional<Instant> came_at_;       ///< What that was when the newest reading came.
  Lag lag_;                              ///< Of the last readings …
  Lag lag_before_;                       ///< … and of those before.
  std::optional<Instant> used_at_;
  bool is_silent_{false};
  bool lags_{false};
  bool told_silent_{false};
};

}  // namespace fiducap
