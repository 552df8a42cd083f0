#pragma once

#include <limits>
#include <string>
#include <vector>

namespace fiducap {

/// Where an axis has a line, and what stands there; empty: a faint line in between.
struct PlotTick {
  double value{};
  std::string text;
};

/// What one axis of a plot shows: a range, and at which numbers it is labelled.
class PlotAxis final {
 public:
  enum class Scale { kLinear, kLogarithmic };
  enum class Ends {
    kAsGiven,  ///< The range is that of the values.
    kRound,    ///< It begins and ends at a tick.
  };

  explicit PlotAxis(Scale scale = Scale::kLinear) : scale_(scale) {}

  /// This value is to be seen; what cannot be shown is passed over.
  void add(double value);
  /// No more values come. Without any the range is 0 … 1 (1 … 10); a single one gets room around
  /// it.
  /// @param ticks  about so many, of a linear axis
  void finish(int ticks, Ends ends);
  /// A range of one's own. @pre low < high, both can be shown
  void span(double low, double high, int ticks);

  /// Finite, and positive on a logarithmic axis.
  [[nodiscard]] bool can_show(double value) const;
  /// 0 at the beginning of the axis, 1 at its end. @pre can_show(value)
  [[nodiscard]] double share(double value) const;
  [[nodiscard]] double low() const { return low_; }
  [[nodiscard]] double high() const { return high_; }
  /// Linear: at multiples of 1, 2 or 5 times a power of ten. Logarithmic: at powers of ten, with
  /// faint ones in between.
  [[nodiscard]] std::vector<PlotTick> ticks() const;

 private:
  void finish_decades(Ends ends);

  Scale scale_;
  double low_{std::numeric_limits<double>::infinity()};
  double high_{-std::numeric_limits<double>::infinity()};
  double step_{1};  ///< Of a linear axis.
};

}  // namespace fiducap
