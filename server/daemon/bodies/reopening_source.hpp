#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/clock.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// A device that comes back: when it is lost, or was not there at the start, it is opened again and
/// again, with pauses that grow to half a minute and are short again after a minute of samples. The
/// end of a source (a recording, a stop) stays the end.
class ReopeningSource final : public SensorSource {
 public:
  using Open = std::function<Expected<std::unique_ptr<SensorSource>>()>;
  struct Listener {
    std::function<void(const Error&)> lost;  ///< Once per loss, and when the reason changes.
    std::function<void()> back;              ///< When it has given samples for a few seconds.
  };
  static constexpr Duration kBackAfter = std::chrono::seconds(3);
  static constexpr Duration kForgiven = std::chrono::minutes(1);
  static constexpr Duration kShortestPause = std::chrono::milliseconds(250);
  static constexpr Duration kLongestPause = std::chrono::seconds(30);

  /// @param first  as opened at the start, or why it could not be
  /// @param clock  outlives the source
  ReopeningSource(Expected<std::unique_ptr<SensorSource>> first, Open open, Listener listener,
                  const Clock& clock);

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

 private:
  [[nodiscard]] Expected<std::optional<SensorSample>> ask(std::stop_token stop);
  void note_sample();
  void lose(const Error& why);
  [[nodiscard]] bool wait_and_reopen(std::stop_token stop);

  std::unique_ptr<SensorSource> source_;
  Open open_;
  Listener listener_;
  const Clock& clock_;
  Duration pause_{kShortestPause};
  std::optional<Instant> gives_since_;  ///< Samples, without a loss.
  Instant gave_at_{};                   ///< The last one.
  std::string told_;                    ///< Why it is lost; empty: it is not.
  std::optional<Error> at_start_;
};

}  // namespace fiducap
