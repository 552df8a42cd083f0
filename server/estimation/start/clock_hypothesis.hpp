#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "estimation/body_filter.hpp"
#include "estimation/start/start_lessons.hpp"

namespace fiducap {

/// What the cameras' clocks may be at a start, and how much a filter that starts so may learn of
/// them.
struct ClockHypothesis {
  std::vector<double> shifts_s;  ///< One per camera, beyond what the configuration says.
  double spread{};               ///< 1-sigma of them, in sigmas of the configured shift; 0: held.

  /// @param configured_s  1-sigma of a camera's shift
  [[nodiscard]] double sigma_s(double configured_s) const {
    constexpr double kHeld_s = 0.001;  // a clock that is held may be off by so much
    return std::max(std::min(kHeld_s, configured_s), spread * configured_s);
  }
  friend bool operator==(const ClockHypothesis&, const ClockHypothesis&) = default;
};

/// How badly something explains the images: −2 log likelihood but for a constant, of so many
/// numbers.
struct Explanation {
  double cost{};
  double numbers{};

  Explanation& operator+=(const Explanation& other) {
    cost += other.cost;
    numbers += other.numbers;
    return *this;
  }
};

/// A filter that begins with a hypothesis about the clocks, and can say how well it does.
class StartingFilter : public BodyFilter {
 public:
  /// What the image of the last update() costs.
  [[nodiscard]] virtual Explanation explain(const TagObservations& seen,
                                            const UpdateReport& report) const = 0;
  /// It has begun to follow the motion.
  [[nodiscard]] virtual bool is_following() const = 0;
  /// Images in a row of which at least half of the tags contradict.
  [[nodiscard]] virtual int contradicting_images() const = 0;
  [[nodiscard]] virtual StartLessons lessons() const = 0;
  virtual void begin_with(const StartLessons& lessons) = 0;
  /// The start is over: from now on a contradiction is a clock that jumped or a tag that moved, and
  /// clocks that were held are free.
  virtual void end_start() = 0;
  /// The axes that poses are given out in: anchored, and by which tag of its own; nullopt: by the
  /// map.
  struct Axes {
    bool are_anchored{};
    std::optional<int> defined_by{};
    friend bool operator==(const Axes&, const Axes&) = default;
  };
  [[nodiscard]] virtual Axes axes() const = 0;
  /// How often it has forgotten everything; goes on from `generation`.
  [[nodiscard]] virtual int generation() const = 0;
  virtual void set_generation(int generation) = 0;
  /// How it starts when it has forgotten everything; without: as it did the first time.
  virtual void set_restart_clocks(ClockHypothesis clocks) = 0;
};

}  // namespace fiducap
