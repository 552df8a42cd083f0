#pragma once

#include <optional>
#include <span>
#include <string>

#include "estimation/body_filter.hpp"

namespace fiducap {

/// What most tags say is up: on walls they hang upright (their y axis), on the floor they lie face
/// up, on the ceiling face down.
struct UpGuess {
  Eigen::Vector3d up_W;
  int agree{};  ///< Tags that say so …
  int of{};     ///< … of so many.
};

/// @return nullopt where tags do not tell: fewer than three, or all on one wall or floor, which
/// look alike
[[nodiscard]] std::optional<UpGuess> guess_up(std::span<const TagBelief> tags);

/// Without an IMU nothing says what is up: z of the workspace is the way the first tag looks. Says
/// that it is a guess, and whether the other tags agree. The workspace is not turned by it: poses
/// were given out.
class UpCheck final {
 public:
  /// @param is_surveyed  tags' places were told, and with them what is up
  UpCheck(bool has_imu, const WorkspaceGauge& gauge, bool is_surveyed)
      : gauge_(gauge), is_over_(has_imu || gauge.X_WT || is_surveyed) {}

  /// @return what is new, as one line; empty most of the time
  [[nodiscard]] std::string add(Instant at, const std::optional<BodyEstimate>& estimate,
                                std::span<const TagBelief> own, std::span<const KnownTag> known);

 private:
  [[nodiscard]] std::string wait_for_floor(Instant at, std::span<const TagBelief> own);

  WorkspaceGauge gauge_;
  bool is_over_;  ///< Nothing to say, or all is said.
  bool is_guess_told_{false};
  bool is_wait_told_{false};
  std::optional<Instant> waits_since_;
  std::optional<Instant> looked_at_;
};

}  // namespace fiducap
