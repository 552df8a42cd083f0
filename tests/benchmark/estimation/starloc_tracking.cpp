#include "estimation/starloc.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "detection/tag_geometry.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap::bench {
namespace {

constexpr double kPoint_m = 0.001;
constexpr double kPlaceSigma_m = 0.03;
constexpr double kTurnSigma_rad = 0.1;  // moves a corner of such a tag by nothing
constexpr int kSquare = 100'000;        // and up: no tag has such an id
constexpr double kSquare_m = 1;
constexpr double kSquareAhead_m = 3;
constexpr double kHelped_s = 2;
constexpr std::size_t kLeastTags = 4;

/// The centres of one stereo image.
struct Image {
  double t_s{};  ///< Vicon's clock.
  std::vector<StarlocRun::Centre> centres;
};

Instant instant_of(double t_s) {
  return instant_from_ns(static_cast<std::int64_t>((t_s + 100) * 1e9));
}

class Tracker final {
 public:
  Tracker(const StarlocRun& run, const CameraClock& camera, const ImuClock* imu,
          const StarlocChoice& choice)
      : run_(run), camera_(camera), imu_(choice.use_imu ? imu : nullptr), choice_(choice) {
    BodySensors sensors;
    for (const double across : {0.0, run.baseline_m}) {
      CameraMount mount;
      mount.model = run.camera;
      mount.X_BV = camera.X_RV * Pose{Eigen::Quaterniond::Identity(), {across, 0, 0}};
      sensors.cameras.push_back(mount);
    }
    // A consumer unit with an unknown place: its lever arm is in the accelerometer's noise.
    if (imu_ != nullptr) sensors.imu = ImuNoise{2e-3, 5e-5, 5e-2, 1e-3, 200};
    EstimatorConfig config;
    config.corner_noise_px = 2 * choice.centre_sigma_px;
    config.estimate_extrinsics = false;
    config.estimate_clocks = !choice.corrected_clocks;
    config.learn_corner_noise = false;  // the four corners of a centre are equal
    filter_ = make_body_filter(choice.filter, sensors, {}, config);
    for (const auto& [id, p_WT] : run.tags) known_.push_back(point_tag(id, p_WT));
    group_images();
  }

  StarlocTracking go() {
    std::size_t next_imu = 0;
    for (const Image& image : images_) {
      while (imu_ != nullptr && next_imu < run_.imu.size()) {
        const auto& sample = run_.imu[next_imu++];
        const double t_s = sample.t_s + (choice_.corrected_clocks ? imu_->offset_s : 0);
        filter_->propagate({instant_of(t_s), imu_->q_RI * sample.w_I, imu_->q_RI * sample.f_I});
        if (t_s >= image.t_s) break;
      }
      show(image);
    }
    return summary();
  }

 private:
  static KnownTag point_tag(int id, const Eigen::Vector3d& p_WT) {
    KnownTag tag{id, kPoint_m, {Eigen::Quaterniond::Identity(), p_WT}, Matrix6d::Zero()};
    tag.covariance.diagonal().head<3>().setConstant(kPlaceSigma_m * kPlaceSigma_m);
    tag.covariance.diagonal().tail<3>().setConstant(kTurnSigma_rad * kTurnSigma_rad);
    return tag;
  }

  void group_images() {
    double last = -1;
    for (const auto& centre : run_.centres) {
      if (!run_.tags.contains(centre.tag_id)) continue;
      if (centre.t_s != last) {
        const double t_s =
            choice_.corrected_clocks ? camera_.to_vicon(centre.t_s, middle_of(run_)) : centre.t_s;
        images_.push_back({t_s, {}});
      }
      last = centre.t_s;
      images_.back().centres.push_back(centre);
    }
  }

  static TagObservation observation(int id, double edge_m,
                                    const std::array<Eigen::Vector2d, 4>& corners_px) {
    TagObservation tag;
    tag.tag_id = id;
    tag.edge_m = edge_m;
    tag.corners_px = corners_px;
    tag.raw_px = corners_px;
    tag.ideal_from_raw.fill(Eigen::Matrix2d::Identity());
    return tag;
  }

  /// A point seen as the corners of a tag that is nearly one.
  static TagObservation point(int id, const Eigen::Vector2d& px) {
    constexpr double kHalf_px = 0.1;
    return observation(
        id, kPoint_m,
        {px + Eigen::Vector2d(-kHalf_px, kHalf_px), px + Eigen::Vector2d(kHalf_px, kHalf_px),
         px + Eigen::Vector2d(kHalf_px, -kHalf_px), px + Eigen::Vector2d(-kHalf_px, -kHalf_px)});
  }

  void show(const Image& image) {
    const auto truth = run_.rig_at(image.t_s);
    const auto alone = truth ? least_squares(image, *truth) : std::nullopt;
    if (alone) pnp_.push_back((alone->p - truth->p).norm());
    if (alone && !first_help_s_) first_help_s_ = image.t_s;
    const bool starting = !first_help_s_ || image.t_s - *first_help_s_ < kHelped_s;
    const bool helped = alone && (starting || !has_pose_ || imu_ == nullptr);
    if (helped && !is_in_view(*alone)) place_square(*alone);
    result_.helped += helped ? 1 : 0;
    std::vector<KnownTag> known = known_;
    if (helped) known.push_back(square_);
    for (int camera = 0; camera < 2; ++camera) {
      TagObservations seen;
      seen.camera = camera;
      seen.exposed_at = instant_of(image.t_s);
      for (const auto& c : points_of(image))
        seen.tags.push_back(point(c.tag_id, camera == 0 ? c.left_px : c.right_px));
      if (helped) add_square(*alone, camera, seen);
      const UpdateReport report = filter_->update(seen, {known});
      result_.used += report.tags_used;
      result_.rejected += report.tags_rejected;
    }
    has_pose_ = filter_->running() && filter_->estimate().anchored;
    if (!starting && truth) compare(image.t_s, *truth);
  }

  /// Gauss–Newton over all centres of both images.
  [[nodiscard]] std::optional<Pose> least_squares(const Image& image, Pose X_WR) const {
    if (image.centres.size() < kLeastTags) return std::nullopt;
    for (int i = 0; i < 10; ++i) {
      Matrix6d A = 1e-9 * Matrix6d::Identity();
      Vector6d b = Vector6d::Zero();
      for (const auto& c : image.centres)
        for (int camera = 0; camera < 2; ++camera) add_centre(c, camera, X_WR, A, b);
      const Vector6d d = A.ldlt().solve(b);
      X_WR = {(exp_so3(d.tail<3>()) * X_WR.q).normalized(), X_WR.p + d.head<3>()};
      if (!X_WR.p.allFinite()) return std::nullopt;
    }
    return X_WR;
  }

  void add_centre(const StarlocRun::Centre& c, int camera, const Pose& X_WR, Matrix6d& A,
                  Vector6d& b) const {
    const Pose X_RV =
        camera_.X_RV * Pose{Eigen::Quaterniond::Identity(), {camera * run_.baseline_m, 0, 0}};
    const Pose X_VW = (X_WR * X_RV).inverse();
    const Eigen::Vector3d p_WT = run_.tags.at(c.tag_id);
    const Eigen::Vector3d p = X_VW * p_WT;
    if (p.z() < 0.1) return;
    const Eigen::Vector2d y = (camera == 0 ? c.left_px : c.right_px) - run_.camera.pinhole(p);
    Eigen::Matrix<double, 2, 3> d_point;
    d_point << run_.camera.fu / p.z(), 0, -run_.camera.fu * p.x() / (p.z() * p.z()),  //
        0, run_.camera.fv / p.z(), -run_.camera.fv * p.y() / (p.z() * p.z());
    Eigen::Matrix<double, 2, 6> J;
    J << -d_point * X_VW.rotation(), d_point * X_VW.rotation() * skew(p_WT - X_WR.p);
    // Cauchy: a wrong tag must not rotate the rig.
    const double weight =
        1 / (1 + y.squaredNorm() / (9 * choice_.centre_sigma_px * choice_.centre_sigma_px));
    A += weight * J.transpose() * J;
    b += weight * J.transpose() * y;
  }

  /// Without IMU a few points do not determine a pose: only the square is used.
  [[nodiscard]] const std::vector<StarlocRun::Centre>& points_of(const Image& image) const {
    static const std::vector<StarlocRun::Centre> kNone;
    return imu_ == nullptr ? kNone : image.centres;
  }

  /// The square placed last, from the front, by its middle.
  [[nodiscard]] bool is_in_view(const Pose& X_WR) const {
    if (result_.starts == 0) return false;
    const Pose X_VT = (X_WR * camera_.X_RV).inverse() * square_.X_WT;
    if (X_VT.p.z() < 1.5 || (X_VT.q * Eigen::Vector3d::UnitZ()).dot(X_VT.p) > -0.5 * X_VT.p.norm())
      return false;
    const Eigen::Vector2d px = run_.camera.pinhole(X_VT.p);
    return px.x() > 0 && px.y() > 0 && px.x() < run_.camera.width && px.y() < run_.camera.height;
  }

  void place_square(const Pose& X_WR) {
    // Faces the camera, upright in its image.
    const Pose X_VT{exp_so3({std::acos(-1.0), 0, 0}), {0, 0, kSquareAhead_m}};
    square_ = {kSquare + result_.starts++, kSquare_m, X_WR * camera_.X_RV * X_VT, Matrix6d::Zero()};
    square_.covariance.diagonal().head<3>().setConstant(kPlaceSigma_m * kPlaceSigma_m);
    square_.covariance.diagonal().tail<3>().setConstant(0.02 * 0.02);
  }

  void add_square(const Pose& X_WR, int camera, TagObservations& seen) const {
    const Pose X_RV =
        camera_.X_RV * Pose{Eigen::Quaterniond::Identity(), {camera * run_.baseline_m, 0, 0}};
    const Pose X_VT = (X_WR * X_RV).inverse() * square_.X_WT;
    std::array<Eigen::Vector2d, 4> px;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector3d p = X_VT * tag_corner(i, kSquare_m);
      if (p.z() < 0.3) return;
      px[static_cast<std::size_t>(i)] = run_.camera.pinhole(p);
    }
    if ((X_VT.q * Eigen::Vector3d::UnitZ()).dot(X_VT.p) > 0) return;  // from behind
    seen.tags.push_back(observation(square_.tag_id, kSquare_m, px));
  }

  void compare(double t_s, const Pose& truth) {
    ++result_.images;
    if (!has_pose_) return;
    const BodyEstimate e = filter_->estimate();
    ++result_.with_pose;
    const double error = (e.X_WB.p - truth.p).norm();
    errors_.push_back(error);
    turns_.push_back(angle_between(e.X_WB.q, truth.q));
    const Eigen::Matrix3d P = e.covariance.topLeftCorner<3, 3>();
    const Eigen::Vector3d d = e.X_WB.p - truth.p;
    constexpr double kChi3_95 = 7.815;
    covered_ += d.dot(P.ldlt().solve(d)) < kChi3_95 ? 1 : 0;
    if (error > result_.worst_m) {
      result_.worst_m = error;
      result_.worst_at_s = t_s - images_.front().t_s;
    }
  }

  static double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
  }
  StarlocTracking summary() {
    result_.median_m = quantile(errors_, 0.5);
    result_.p95_m = quantile(errors_, 0.95);
    result_.rmse_m = rms(errors_);
    result_.rmse_rad = rms(turns_);
    result_.covered = errors_.empty() ? 0 : covered_ / static_cast<double>(errors_.size());
    result_.pnp_median_m = quantile(pnp_, 0.5);
    result_.pnp_images = static_cast<int>(pnp_.size());
    return result_;
  }

  const StarlocRun& run_;
  const CameraClock& camera_;
  const ImuClock* imu_;
  StarlocChoice choice_;
  std::unique_ptr<BodyFilter> filter_;
  std::vector<KnownTag> known_;
  std::vector<Image> images_;
  KnownTag square_;
  std::optional<double> first_help_s_;
  bool has_pose_{false};  ///< After the last image.
  StarlocTracking result_;
  std::vector<double> errors_, turns_, pnp_;
  int covered_{0};
};

}  // namespace

StarlocTracking track(const StarlocRun& run, const CameraClock& camera, const ImuClock* imu,
                      const StarlocChoice& choice) {
  return Tracker(run, camera, imu, choice).go();
}

}  // namespace fiducap::bench
