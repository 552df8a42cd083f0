#include "calibration/extrinsics/camera_imu_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <locale>
#include <optional>
#include <sstream>
#include <utility>

#include "base/pose.hpp"
#include "detection/observe.hpp"
#include "estimation/start/time_offset.hpp"

namespace fiducap {
namespace {

constexpr double kGoodPosition_m = 0.003;
constexpr double kGoodRotation_rad = 0.001;
// s: 1-sigma of the measured offset with which the filter starts, at least: shutter, lens.
constexpr double kLeastClock_s = 0.003;
// A second has ten: three minutes, 2 MB.
constexpr std::size_t kMostTurns = 2000;

class Calibration final {
 public:
  Calibration(OfflineSetup setup, const LoadedSamples& samples, const CalibrationOptions& options,
              const CalibrationProgress& progress)
      : setup_(std::move(setup)), samples_(samples), options_(options), progress_(progress) {
    nominal_ = setup_.sensors.cameras;
    for (CameraMount& camera : setup_.sensors.cameras) {
      camera.position_sigma_m = options.position_sigma_m;
      camera.rotation_sigma_rad = options.rotation_sigma_rad;
    }
    setup_.estimator.estimate_extrinsics = true;
    setup_.estimator.estimate_clocks = options.search_time;
    setup_.estimator.learn_corner_noise = false;
  }

  Expected<CameraImuCalibration> run() {
    if (!samples_.begins_still) {
      const auto rest = first_rest(samples_);
      result_.begins_in_motion = !rest;
      if (rest) begin_ = *rest;
    }
    if (options_.search_time) {
      result_.time = time_shift();
      if (result_.time.determined)
        for (CameraMount& camera : setup_.sensors.cameras)
          camera.time_shift_sigma_s = std::max(kLeastClock_s, result_.time.sigma_s);
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
  /// By the rotations of cameras and gyroscope: mean of all cameras.
  ShiftResult time_shift() {
    GyroIntegral gyro(setup_.sensors.imu->gyro_range_rad_s);
    std::vector<TimeOffset> offsets;
    for (const CameraMount& camera : nominal_)
      offsets.emplace_back(camera.model, camera.X_BV.q, setup_.estimator.corner_noise_px,
                           kMostTurns);
    SampleReplay samples(samples_, Duration{0}, begin_);
    TagObservations seen;
    while (const auto sample = samples.next({}).value_or(std::nullopt)) {
      if (const auto* imu = std::get_if<ImuSample>(&*sample)) {
        gyro.add(*imu);
        continue;
      }
      const auto& frame = std::get<CornerFrame>(*sample);
      const auto k = static_cast<std::size_t>(frame.camera);
      observe(frame, nominal_[k].model, setup_.tags, setup_.detector, seen);
      offsets[k].add(seen, gyro);
    }
    double sum = 0, information = 0;
    for (const TimeOffset& offset : offsets) {
      const OffsetFit fit = offset.fit(Axes::kConfigured, {}, kMostTurns);
      if (!fit.explains() || !fit.is_unique) continue;
      const double weight = 1 / (fit.shift_sigma_s * fit.shift_sigma_s);
      sum += weight * fit.shift_s;
      information += weight;
    }
    if (!(information > 0)) return ShiftResult{.determined = false};
    const double shift_s = sum / information;
    return {shift_s, 1 / std::sqrt(information), std::abs(shift_s) > options_.time_range_s, true};
  }

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
