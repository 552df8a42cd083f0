#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

constexpr int kMostCameras = 16;  ///< Of one body.

/// Keeps one wrong stamp from silencing a sensor: after a reading from the far future all true ones
/// would come too late.
///
/// A sample that is far ahead of all that were seen waits for the next one of its sensor, or for
/// any that is near it. What comes shows who was right: when time goes on from there, both pass;
/// when it goes on from where it was, the one that waited is dropped. So does the first sample of
/// all. Nothing else waits, and the order of a sensor's samples stays. Allocates nothing per
/// sample.
class JumpGate final {
 public:
  /// @param jump  further ahead is far: longer than the pauses that are usual
  explicit JumpGate(Duration jump);

  /// @return what may go on now, in order of arrival; valid until the next call
  [[nodiscard]] std::vector<SensorSample>& take(SensorSample sample);
  /// Nothing more will come. @return what may still go on
  [[nodiscard]] std::vector<SensorSample>& finish();
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  using Held = std::optional<SensorSample>;
  [[nodiscard]] bool is_far_ahead(Instant at) const;
  [[nodiscard]] bool is_confirmed_by(const Held& held, Instant at) const;
  void judge_own(Held& held, Instant at);
  void pass(SensorSample sample);
  void pass_held(Held& held);

  Duration jump_;
  std::array<Held, 1 + kMostCameras> held_;  ///< IMU, cameras.
  int waiting_{0};
  std::optional<Instant> newest_;  ///< Of those that went on.
  std::vector<SensorSample> out_;
  std::uint64_t dropped_{0};
};

}  // namespace fiducap
