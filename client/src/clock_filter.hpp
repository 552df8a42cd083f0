#pragma once

#include <array>
#include <cstddef>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// The four timestamps of one request and its reply.
struct ClockSample {
  Nanoseconds asked{};     ///< t1, own clock.
  Nanoseconds received{};  ///< t2, server's clock.
  Nanoseconds answered{};  ///< t3, server's clock.
  Nanoseconds returned{};  ///< t4, own clock.
};

/// Offset of the server's clock at one instant: server = own + offset.
struct ClockEstimate {
  bool known{};
  Nanoseconds offset{};
  double drift{};         ///< Growth of the offset, s/s.
  double sigma_s{};       ///< 1-sigma by jitter, without asymmetric delays.
  double bound_s{};       ///< Bound of the error for any asymmetry: half the least round trip.
  double round_trip_s{};  ///< The least one of the window.
  int samples{};
};

/// Offset and drift between two clocks from four-timestamp samples over links with jitter.
///
/// Delays are positive: t2 - t1 is above the offset and t3 - t4 below. Both edges move with the
/// drift, so one slope and two edges are fitted to the samples of the last half minute; the offset
/// is midway between the edges. With one edge per direction, jitter averages out like 1/n; the
/// shortest round trip of n gives 1/sqrt(n). The slope is the most probable one for exponential
/// waiting times and crystals within 100 ppm (1-sigma); for a known slope this is the linear
/// programme of S. Moon, P. Skelly, D. Towsley, "Estimation and removal of clock skew from network
/// delay measurements", INFOCOM 1999, in both directions at once. A sample that contradicts the
/// estimate (negative delay) means that a clock was set: the filter is reset.
class ClockFilter {
 public:
  void reset();
  /// Samples in order of `returned`. Ones with negative spans are ignored.
  void add(const ClockSample& sample);
  ClockEstimate at(Nanoseconds own_time) const;

 private:
  static constexpr std::size_t kKept = 320;
  struct Sample {
    double at_s;     ///< Own time since `origin_`, middle of the round trip.
    double upper_s;  ///< t2 - t1 - base_: not below the offset.
    double lower_s;  ///< t3 - t4 - base_: not above it.
  };
  struct Edges {
    double upper_s;
    double lower_s;
  };

  void keep(const Sample& sample);
  void fit();
  /// Edges at the mean time of the samples for a given drift.
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
