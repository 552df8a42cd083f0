#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

#include "base/expected.hpp"

namespace fiducap::dds {

/// Participants of the domain, this one and forged ones included.
struct Crowd {
  static constexpr int kMostPresent = 256;
  static constexpr int kMostMet = 4096;

  int present{};  ///< Now.
  int met{};      ///< Since it was joined.

  /// More than can be true.
  [[nodiscard]] bool is_too_big() const { return present > kMostPresent || met > kMostMet; }
};

/// Counts the participants that a participant knows. Thread-safe.
class CrowdWatch final {
 public:
  using Alarm = std::function<void(const Crowd&)>;

  /// @param alarm  called once when there are too many, on a thread of the middleware
  explicit CrowdWatch(Alarm alarm) : alarm_(std::move(alarm)) {}
  /// @param participant  dies before the watch
  [[nodiscard]] Expected<void> watch(std::int32_t participant);
  [[nodiscard]] Crowd crowd() const { return {present_, met_}; }
  [[nodiscard]] bool is_crowded() const { return crowded_; }

 private:
  void look(std::int32_t reader);
  void count(bool is_new, bool is_alive);

  Alarm alarm_;
  std::atomic<int> present_{0};
  std::atomic<int> met_{0};
  std::atomic<bool> crowded_{false};
};

}  // namespace fiducap::dds
