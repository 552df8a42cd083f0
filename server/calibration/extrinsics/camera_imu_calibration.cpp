#include "calibration/extrinsics/camera_imu_calibration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <locale>
#include <sstream>
#include <utility>

#include "base/so3.hpp"
#include "calibration/extrinsics/calm_watch.hpp"
#include "estimation/filter/chi_square.hpp"

namespace fiducap {
namespace {

constexpr double kGoodPosition_m = 0.003;
constexpr double kGoodRotation_rad = 0.001;
constexpr int kCornerNumbers = 8;
constexpr double kSearched_s = 0.003;  // how far the search may be off
/// A tag that the filter could not use costs a little more than one that fits: a run that uses
/// nothing must not win.
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
    // The search below finds the shift where the innovations are smallest: nothing else may explain
    // them away.
    setup_.estimator.estimate_clocks = false;
    setup_.estimator.learn_corner_noise = false;
  }

  Expected<CameraImuCalibration> run() {
    if (!samples_.begins_calm) {
      const auto calm = first_calm(samples_);
      result_.begins_in_motion = !calm;
      if (calm) begin_ = *calm;
    }
    if (options_.search_time) {
      const auto time =
          search_time_shift([this](double s) { return cost_of(s); }, options_.time_range_s);
      if (!time) return tl::unexpected(time.error());
      result_.time = *time;
      free_clocks();
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
                    "the filter never followed the tags: are their sizes and the camera's "
                    "calibration right?");
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
  /// What the search has found is right to a millisecond or so. What place and attitude owe to the
  /// rest, the filter knows: a clock that is held makes them surer than they are.
  void free_clocks() {
    setup_.estimator.estimate_clocks = true;
    if (!result_.time.determined) return;
    for (CameraMount& camera : setup_.sensors.cameras) camera.time_shift_sigma_s = kSearched_s;
  }

  /// Beyond what was replayed, mean of all cameras; the largest of their sigmas is the result's.
  double learned_shift_s(const OfflineResult& run) {
    double sum_s = 0, sigma_s = 0;
    for (const ExtrinsicsEstimate& camera : run.extrinsics) {
      sum_s += camera.clock.shift_s;
      sigma_s = std::max(sigma_s, camera.clock.shift_sigma_s);
    }
    if (sigma_s > 0) result_.time.sigma_s = sigma_s;  // the paper's filter estimates none
    return sum_s / static_cast<double>(run.extrinsics.size());
  }

  Expected<OfflineResult> run_filter(double shift_s, const std::string& what) {
    if (progress_) progress_(what);
    ++result_.runs;
    SampleReplay replay(samples_, from_seconds(shift_s), begin_);
    return run_offline(setup_, replay);
  }

  /// Summed NIS of what was used; the rest at what it costs at least.
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

Expected<CameraImuCalibration> calibrate_camera_imu(OfflineSetup setup,
                                                    const LoadedSamples& samples,
                                                    const CalibrationOptions& options,
                                                    const CalibrationProgress& progress) {
  if (!setup.sensors.imu || samples.imu.empty())
    return fail(ErrorCode::kInvalid,
                "has no IMU samples: there is nothing to calibrate the camera against");
  if (samples.tags == 0) return fail(ErrorCode::kInvalid, "shows no tag in any image");
  return Calibration(std::move(setup), samples, options, progress).run();
}

std::string motion_that_shows(std::size_t axis) {
  static constexpr std::array<const char*, 6> kMotions{
      "turn quickly to and fro about y and z",
      "turn quickly to and fro about x and z",
      "turn quickly to and fro about x and y",
      "turn about y and z, tilt so that gravity is not along x",
      "turn about x and z, tilt so that gravity is not along y",
      "turn about x and y, tilt so that gravity is not along z",
  };
  return kMotions.at(axis);
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
    const bool radial = model.distortion == Distortion::kRadialTangential;
    const std::size_t numbers = model.distortion == Distortion::kNone  ? 0
                                : radial && model.coefficients[4] != 0 ? 5
                                                                       : 4;
    // Kalibr's own names; its camera without lens is written as radtan with zeros by most people,
    // `none` is Kalibr's word.
    out << "  distortion_model: "
        << (numbers == 0 ? "none"
            : radial     ? "radtan"
                         : "equidistant")
        << "\n  distortion_coeffs: [";
    for (std::size_t i = 0; i < numbers; ++i) out << (i == 0 ? "" : ", ") << model.coefficients[i];
    out << "]\n  timeshift_cam_imu: " << to_seconds(camera.time_shift)
        << "  # s, t_imu = t_cam + shift\n";
  }
  return out.str();
}

}  // namespace fiducap
