#pragma once

#include <array>
#include <cstddef>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// One question about the time and its answer.
struct ClockSample {
  Nanoseconds asked{};     ///< t1, own clock.
  Nanoseconds received{};  ///< t2, server's clock.
  Nanoseconds answered{};  ///< t3, server's clock.
  Nanoseconds returned{};  ///< t4, own clock.
};

/// How the server's clock stands to ours at one instant: server = own + offset.
struct ClockEstimate {
  bool known{};
  Nanoseconds offset{};
  double drift{};    ///< Seconds per second that the offset grows.
  double sigma_s{};  ///< 1-sigma of what jitter leaves; nothing about ways of different length.
  double bound_s{};  ///< The error is never larger, however different the two ways are: half the
                     ///< least round trip.
  double round_trip_s{};  ///< The least one of the window.
  int samples{};
};

/// Offset and drift between two clocks from four-timestamp samples over ways with jitter.
///
/// Delays are never negative: t2 - t1 lies above the offset and t3 - t4 below. Both lower edges
/// move with the drift, so one slope and two edges are fitted to the samples of the last half
/// minute; the offset is midway between the edges. Against one edge per direction jitter averages
/// out like 1/n, where the shortest round trip of n gives 1/sqrt(n). The slope is the most probable
/// one if waiting times are exponential and crystals within 100 ppm (1-sigma); for a known slope
/// that is the linear programme of S. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock
/// skew from network delay measurements", INFOCOM 1999, in both directions at once. A sample that
/// contradicts the estimate (faster than light) says that a clock was set: everything starts again.
class ClockFilter {
 public:
  void reset();
  /// Samples in order of `returned`. Ones that cannot be (negative spans) are ignored.
  void add(const ClockSample& sample);
  ClockEstimate at(Nanoseconds own_time) const;

 private:
  static constexpr std::size_t kKept = 320;
  struct Sample {
    double at_s;     ///< Own time since `origin_`, middle of the way there and back.
    double upper_s;  ///< t2 - t1 - base_: not below the offset.
    double lower_s;  ///< t3 - t4 - base_: not above it.
  };
  struct Edges {
    double upper_s;
    double lower_s;
  };

  void keep(const Sample& sample);
  void fit();
  /// At the mean time of the samples, when the offset grows by `drift`.
  Edges edges(double drift) const;
  double log_probability(double drift) const;
  double most_probable_drift() const;
  bool contradicts(const Sample& sample, Nanoseconds own_time) const;

  std::array<Sample, kKept> samples_{};
  std::size_t count_{0};
  std::size_t next_{0};
  Nanoseconds origin_{0};
  Nanoseconds base_{0};  ///< A rough offset, so that doubles keep nanoseconds.

  double mean_at_s_{0};
  double span_s_{0};
  double upper_jitter_s_{0};  ///< Mean excess above the edge.
  double lower_jitter_s_{0};
  double drift_{0};
  Edges edges_{0, 0};
};

}  // namespace fiducap::sdk
