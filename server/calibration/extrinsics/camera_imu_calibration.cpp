#include "calibration/extrinsics/camera_imu_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <locale>
#include <optional>
#include <sstream>
#include <utility>

#include <Eigen/Dense>

#include "base/pose.hpp"
#include "estimation/filter/chi_square.hpp"

namespace fiducap {
namespace {

// A filter started in motion has about the same cost at most wrong shifts; the minimum is narrow. A
// grid of 12 ms missed it by 10 to 30 ms in one recording of twenty.
constexpr double kCell_s = 0.002;
constexpr double kEnough_s = 0.0005;    // end of the golden section
constexpr double kParabola_s = 0.0015;  // spacing of the five points of the parabola
constexpr double kGolden = 0.6180339887498949;
/// Smallest range of the chi-square: smaller ones are caused by images that enter or leave the
/// recording with the shift, and would give a useless sigma (10 sigma over 50 ms are 5 ms).
constexpr double kEvidence = 100;

class ShiftSearch final {
 public:
  ShiftSearch(const ShiftCost& cost, double range_s) : cost_(cost), range_s_(range_s) {}

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
    if (worst - best < kEvidence) return ShiftResult{.determined = false};
    // A negative curvature at the border: the minimum lies beyond.
    if (!result_.determined)
      return ShiftResult{.at_border = result_.at_border, .determined = false};
    return result_;
  }

 private:
  double at(double shift_s) {
    if (failure_) return 0;
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

constexpr double kGoodPosition_m = 0.003;
constexpr double kGoodRotation_rad = 0.001;
constexpr int kCornerNumbers = 8;
constexpr double kSearchSigma_s = 0.003;  // of the searched shift
/// Cost of a tag that the filter could not use, above that of one that fits: a run that uses no
/// tags must not be the minimum.
constexpr double kUnused = 1.5 * kCornerNumbers;

class Calibration final {
 public:
  Calibration(OfflineSetup setup, const LoadedSamples& samples, const CalibrationOptions& options,
              const CalibrationProgress& progress)
      : setup_(std::move(setup)),
        samples_(samples),
        options_(options),
        progress_(progress),
        gate_(chi_square_quantile(kCornerNumbers, setup_.estimator.gate_probability)) {
    nominal_ = setup_.sensors.cameras;
    for (CameraMount& camera : setup_.sensors.cameras) {
      camera.position_sigma_m = options.position_sigma_m;
      camera.rotation_sigma_rad = options.rotation_sigma_rad;
    }
    setup_.estimator.estimate_extrinsics = true;
    // No other state may absorb the innovations that the search minimises.
    setup_.estimator.estimate_clocks = false;
    setup_.estimator.learn_corner_noise = false;
  }

  Expected<CameraImuCalibration> run() {
    if (!samples_.begins_still) {
      const auto rest = first_rest(samples_);
      result_.begins_in_motion = !rest;
      if (rest) begin_ = *rest;
    }
    if (options_.search_time) {
      const auto time =
          search_time_shift([this](double s) { return cost_of(s); }, options_.time_range_s);
      if (!time) return tl::unexpected(time.error());
      result_.time = *time;
      // With the poses, from the searched shift on: fixed clocks would make the covariance of the
      // poses too small.
      setup_.estimator.estimate_clocks = true;
      if (time->determined)
        for (CameraMount& camera : setup_.sensors.cameras)
          camera.time_shift_sigma_s = kSearchSigma_s;
    }
    OfflineResult last;
    double replayed_shift_s = 0;
    for (int pass = 1; pass <= 2; ++pass) {
      replayed_shift_s = result_.time.shift_s;
      auto run = run_filter(replayed_shift_s, "extrinsics, run " + std::to_string(pass) + " of 2");
      if (!run) return tl::unexpected(run.error());
      last = std::move(*run);
      if (last.statistics.tags_used == 0 || last.extrinsics.size() != nominal_.size())
        return fail(ErrorCode::kInvalid,
                    "the filter used no tags: check their sizes and the camera's calibration");
      for (std::size_t k = 0; k < nominal_.size(); ++k)
        setup_.sensors.cameras[k].X_BV = last.extrinsics[k].X_BV;
      result_.time.shift_s = replayed_shift_s + learned_shift_s(last);
    }
    result_.statistics = last.statistics;
    for (std::size_t k = 0; k < nominal_.size(); ++k)
      conclude(k, last.extrinsics[k], replayed_shift_s);
    return std::move(result_);
  }

 private:
  /// Mean of all cameras, beyond the replayed shift; the largest sigma is the result's.
  double learned_shift_s(const OfflineResult& run) {
    double sum_s = 0, sigma_s = 0;
    for (const ExtrinsicsEstimate& camera : run.extrinsics) {
      sum_s += camera.clock.shift_s;
      sigma_s = std::max(sigma_s, camera.clock.shift_sigma_s);
    }
    if (sigma_s > 0) result_.time.sigma_s = sigma_s;  // 0: the filter estimates no clocks
    return sum_s / static_cast<double>(run.extrinsics.size());
  }

  Expected<OfflineResult> run_filter(double shift_s, const std::string& what) {
    if (progress_) progress_(what);
    ++result_.runs;
    SampleReplay replay(samples_, from_seconds(shift_s), begin_);
    return run_offline(setup_, replay);
  }

  /// Summed NIS of used tags, and fixed costs of the others.
  Expected<double> cost_of(double shift_s) {
    const auto run =
        run_filter(shift_s, "time shift " + std::to_string(std::lround(shift_s * 1e6)) +
                                " µs, run " + std::to_string(result_.runs + 1));
    if (!run) return tl::unexpected(run.error());
    const OfflineStatistics& s = run->statistics;
    const auto unused = static_cast<double>(samples_.tags - s.tags_used - s.tags_rejected);
    return s.nis_sum + gate_ * s.tags_rejected + kUnused * unused;
  }

  void conclude(std::size_t k, const ExtrinsicsEstimate& estimate, double replayed_shift_s) {
    CameraVerdict verdict;
    verdict.X_BV = estimate.X_BV;
    for (std::size_t i = 0; i < verdict.axes.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      AxisVerdict& axis = verdict.axes[i];
      axis.sigma = std::sqrt(estimate.covariance(at, at));
      axis.prior_sigma = i < 3 ? options_.position_sigma_m : options_.rotation_sigma_rad;
      axis.observed = axis.sigma < axis.prior_sigma / 2 &&
                      axis.sigma < (i < 3 ? kGoodPosition_m : kGoodRotation_rad);
    }
    verdict.moved_m = (estimate.X_BV.p - nominal_[k].X_BV.p).norm();
    verdict.moved_rad = angle_between(estimate.X_BV.q, nominal_[k].X_BV.q);
    CameraMount mount = nominal_[k];
    mount.X_BV = estimate.X_BV;
    mount.position_sigma_m = std::sqrt(estimate.covariance.topLeftCorner<3, 3>().trace() / 3);
    mount.rotation_sigma_rad = std::sqrt(estimate.covariance.bottomRightCorner<3, 3>().trace() / 3);
    mount.time_shift += from_seconds(replayed_shift_s + estimate.clock.shift_s);
    result_.cameras.push_back(mount);
    result_.verdicts.push_back(verdict);
  }

  OfflineSetup setup_;
  const LoadedSamples& samples_;
  CalibrationOptions options_;
  CalibrationProgress progress_;
  double gate_;
  Instant begin_{Instant::min()};
  std::vector<CameraMount> nominal_;
  CameraImuCalibration result_;
};

}  // namespace

Expected<ShiftResult> search_time_shift(const ShiftCost& cost, double range_s) {
  return ShiftSearch(cost, range_s).run();
}

Expected<CameraImuCalibration> calibrate_camera_imu(OfflineSetup setup,
                                                    const LoadedSamples& samples,
                                                    const CalibrationOptions& options,
                                                    const CalibrationProgress& progress) {
  if (!setup.sensors.imu || samples.imu.empty())
    return fail(ErrorCode::kInvalid,
                "has no IMU samples: the camera is calibrated relative to the IMU");
  if (samples.tags == 0) {
    const std::string why = why_no_tag(samples.few.images(), setup.tags, setup.detector);
    return fail(ErrorCode::kInvalid, "shows no tag in any image" + (why.empty() ? "" : ": " + why));
  }
  return Calibration(std::move(setup), samples, options, progress).run();
}

std::string motion_for_axis(std::size_t axis) {
  static constexpr std::array kAxes{"x", "y", "z"};
  static constexpr std::array kOthers{"y and z", "x and z", "x and y"};
  const std::string others = kOthers.at(axis % 3);
  if (axis < 3) return "rotate quickly back and forth about " + others;
  return "rotate about " + others + ", tilt so that gravity is not along " + kAxes.at(axis % 3);
}

std::string to_kalibr_camchain(const std::vector<CameraMount>& cameras,
                               const std::string& heading) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out.precision(12);
  out << "# " << heading << "\n";
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const CameraMount& camera = cameras[k];
    const CameraModel& model = camera.model;
    const Pose T_cam_imu = camera.X_BV.inverse();
    const Eigen::Matrix3d R = T_cam_imu.rotation();
    out << "cam" << k << ":\n  T_cam_imu:\n";
    for (int row = 0; row < 3; ++row)
      out << "  - [" << R(row, 0) << ", " << R(row, 1) << ", " << R(row, 2) << ", "
          << T_cam_imu.p(row) << "]\n";
    out << "  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n  intrinsics: [" << model.fu << ", "
        << model.fv << ", " << model.cu << ", " << model.cv << "]\n  resolution: [" << model.width
        << ", " << model.height << "]\n";
    // Kalibr's names.
    const bool radial = model.distortion == Distortion::kRadialTangential;
    out << "  distortion_model: " << (radial ? "radtan" : name_of(model.distortion))
        << "\n  distortion_coeffs: [";
    const char* comma = "";
    for (const double k : listed_coefficients(model)) out << std::exchange(comma, ", ") << k;
    out << "]\n  timeshift_cam_imu: " << to_seconds(camera.time_shift)
        << "  # s, t_imu = t_cam + shift\n";
  }
  return out.str();
}

}  // namespace fiducap
