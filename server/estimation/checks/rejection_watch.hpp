#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "estimation/body_estimate.hpp"

namespace fiducap {

/// Notices when a large share of the tags in view has contradicted the rest for many seconds: then
/// something that all of them have in common is wrong (sizes, lens, extrinsics), and no single tag
/// is the cause.
class RejectionWatch final {
 public:
  /// Every image, in order of time.
  /// @return the share, once, when it has been above 30 % over ten seconds; again only after it was
  /// below 15 % in between
  [[nodiscard]] std::optional<double> add(const UpdateReport& report);

 private:
  static constexpr std::size_t kSeconds = 10;

  struct Second {
    int used{0};
    int rejected{0};
  };
  [[nodiscard]] std::optional<double> judge();

  std::array<Second, kSeconds> seconds_{};
  std::size_t full_{0};  ///< Seconds that are complete.
  std::optional<Instant> begun_at_;
  Second now_{};
  bool said_{false};
};

}  // namespace fiducap
