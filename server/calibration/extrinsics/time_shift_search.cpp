#include "calibration/extrinsics/time_shift_search.hpp"

#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Dense>

namespace fiducap {
namespace {

// A filter that begins while the body swings errs with any wrong shift, and as badly with most: its
// cost falls only so near the right one. With cells of 12 ms one wave in twenty that began gently
// ended 10 to 30 ms beside it.
constexpr double kCell_s = 0.002;
constexpr double kEnough_s = 0.0005;    // where the golden section stops
constexpr double kParabola_s = 0.0015;  // spacing of the five points of the parabola
constexpr double kGolden = 0.6180339887498949;
/// A chi-square that falls by less than this over the range is no evidence: images at the ends of
/// the recording come and go with the shift, and what it would tell is of no use (10 sigma over 50
/// ms are 5 ms).
constexpr double kEvidence = 100;

class Search final {
 public:
  Search(const ShiftCost& cost, double range_s) : cost_(cost), range_s_(range_s) {}

  Expected<ShiftResult> run() {
    const int cells = static_cast<int>(std::ceil(range_s_ / kCell_s));
    double best = std::numeric_limits<double>::infinity();
    double worst = -best;
    double centre = 0;
    for (int i = -cells; i <= cells; ++i) {
      const double shift = range_s_ * i / cells;
      const double value = at(shift);
      worst = std::max(worst, value);
      if (value >= best) continue;
      best = value;
      centre = shift;
      result_.at_border = std::abs(i) == cells;
    }
    const double cell = range_s_ / cells;
    const double narrowed = golden(centre - cell, centre + cell);
    if (!failure_) fit_parabola(narrowed);
    if (failure_) return tl::unexpected(*failure_);
    if (worst - best < kEvidence)
      result_ = {.at_border = false, .determined = false, .evaluations = result_.evaluations};
    if (result_.determined) return result_;
    // At the border it bends the wrong way: the right one lies beyond.
    return ShiftResult{
        .at_border = result_.at_border, .determined = false, .evaluations = result_.evaluations};
  }

 private:
  double at(double shift_s) {
    if (failure_) return 0;
    ++result_.evaluations;
    const auto value = cost_(shift_s);
    if (value) return *value;
    failure_ = value.error();
    return 0;
  }

  double golden(double low, double high) {
    double left = high - kGolden * (high - low);
    double right = low + kGolden * (high - low);
    double at_left = at(left);
    double at_right = at(right);
    while (high - low > kEnough_s && !failure_) {
      if (at_left < at_right) {
        high = right;
        right = left;
        at_right = at_left;
        left = high - kGolden * (high - low);
        at_left = at(left);
      } else {
        low = left;
        left = right;
        at_left = at_right;
        right = low + kGolden * (high - low);
        at_right = at(right);
      }
    }
    return (low + high) / 2;
  }

  /// Least squares through five points; χ² = c + (t − t₀)²/σ².
  void fit_parabola(double centre) {
    Eigen::Matrix<double, 5, 3> A;
    Eigen::Matrix<double, 5, 1> y;
    for (int i = 0; i < 5; ++i) {
      const double u = i - 2;
      A.row(i) << 1, u, u * u;
      y(i) = at(centre + u * kParabola_s);
    }
    const Eigen::Vector3d c = A.colPivHouseholderQr().solve(y);
    result_.shift_s = centre;
    if (!(c(2) > 0)) {
      result_.determined = false;
      return;
    }
    const double vertex = -c(1) / (2 * c(2));
    if (std::abs(vertex) <= 2) result_.shift_s += vertex * kParabola_s;
    result_.sigma_s = kParabola_s / std::sqrt(c(2));
  }

  const ShiftCost& cost_;
  double range_s_;
  ShiftResult result_;
  std::optional<Error> failure_;
};

}  // namespace

Expected<ShiftResult> search_time_shift(const ShiftCost& cost, double range_s) {
  return Search(cost, range_s).run();
}

}  // namespace fiducap
