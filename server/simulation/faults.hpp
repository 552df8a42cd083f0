#pragma once

#include <cstdint>
#include <vector>

#include "base/time.hpp"
#include "capture/camera_frame.hpp"
#include "simulation/simulation.hpp"

namespace fiducap::simulation {

/// What goes wrong, when. Each answer depends on nothing but the seed and the sample asked about.
class Faults final {
 public:
  /// @param ids  in the family: wrong ids are drawn from them
  Faults(const FaultConfig& config, int ids, std::uint64_t seed)
      : config_(config), ids_(ids), seed_(seed) {}

  [[nodiscard]] bool drops_imu(std::uint64_t k) const;
  [[nodiscard]] Duration imu_delay(std::uint64_t k) const;
  /// Dropped by chance or in a blackout.
  [[nodiscard]] bool drops_image(int camera, std::uint64_t k, double t_s) const;
  [[nodiscard]] Duration image_delay(int camera, std::uint64_t k) const;
  /// Takes hidden tags out, moves the moved one, writes wrong ids over the true ones. Order is
  /// kept.
  void touch(int camera, std::uint64_t k, double t_s, std::vector<RecordedTag>& tags) const;
  /// Puts covered corners where a detector would find them. Same order as the tags.
  void cover(int camera, std::uint64_t k, std::vector<TagSighting>& sightings) const;
  /// How much later than the truth the stamps say.
  [[nodiscard]] Duration image_stamp_error() const;
  [[nodiscard]] Duration imu_stamp_error(std::uint64_t k, double rate_hz) const;
  void saturate(double t_s, ImuSample& imu) const;

 private:
  FaultConfig config_;
  int ids_;
  std::uint64_t seed_;
};

}  // namespace fiducap::simulation
