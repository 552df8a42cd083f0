#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "daemon/bodies/body_setup.hpp"
#include "daemon/bodies/body_worker.hpp"
#include "daemon/map_start.hpp"
#include "daemon/server.hpp"
#include "middleware/membership.hpp"

namespace fiducap {

/// Opens the sources of all bodies, and again each that is lost, for as long as the server runs.
class BodyOpening final {
 public:
  struct Body {
    BodySetup setup;
    std::vector<BodySource> sources;
    SimulatedTruth truth;
  };

  /// Everything outlives this, and this the sources.
  /// @param lost  a body has no images any more; its place in the configuration
  BodyOpening(const ServerConfig& config, const ServerOptions& options, const Clock& clock,
              EventBoard& events, dds::Membership& membership,
              std::function<void(std::size_t)> lost);

  /// @return Error: a file that the configuration names is wrong, or not one source can be opened
  [[nodiscard]] Expected<std::vector<Body>> open_all(const StartMap& start);
  [[nodiscard]] Instant simulation_start() const { return simulation_start_; }

 private:
  using Opened = Expected<std::unique_ptr<SensorSource>>;

  [[nodiscard]] Expected<Body> open_body(const BodyConfig& config, const StartMap& start);
  [[nodiscard]] Opened open(const BodyConfig& config, const SensorPart& part, BodySetup& setup);
  [[nodiscard]] bool comes_back(const BodyConfig& config, const SensorPart& part) const;
  [[nodiscard]] std::unique_ptr<SensorSource> keep_open(const BodyConfig& config,
                                                        const SensorPart& part,
                                                        const BodySetup& setup, Opened source);

  const ServerConfig& config_;
  const ServerOptions& options_;
  const Clock& clock_;
  EventBoard& events_;
  dds::Membership& membership_;
  std::function<void(std::size_t)> lost_;
  Instant simulation_start_{};
  std::optional<Error> first_failure_;
  std::size_t opened_{0};  ///< Sources that are there, or may come back.
};

}  // namespace fiducap
