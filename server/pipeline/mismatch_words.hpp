#pragma once

#include <string>
#include <vector>

#include "base/time.hpp"
#include "capture/lens/camera_model.hpp"
#include "estimation/found_mismatch.hpp"

namespace fiducap {

/// What a filter found to be other than configured, in words that say what to do next. Example:
/// `camera 0: the lens is 0.9 ± 0.1 % longer than configured (fu 460.0, seems 464.1); the estimate
/// reckons with it. Run fiducap calibrate camera`.
[[nodiscard]] std::string mismatch_text(const FoundMismatch& found,
                                        const std::vector<CameraMount>& cameras);

/// Says each finding once, and again when it has changed for good.
class MismatchNews final {
 public:
  /// @return what is new among `found`; none most of the time
  [[nodiscard]] std::vector<FoundMismatch> take(const std::vector<FoundMismatch>& found,
                                                Instant now);

 private:
  /// What was said, or waits to be: a finding that does not last is none.
  struct Known {
    FoundMismatch found;  ///< As it was when it was said.
    Instant since{};
    bool is_said{false};
  };
  std::vector<Known> known_;
};

}  // namespace fiducap
