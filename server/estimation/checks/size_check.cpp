#include "estimation/checks/size_check.hpp"

#include <algorithm>
#include <cmath>

#include "base/pose.hpp"
#include "detection/observe.hpp"
#include "detection/tag_geometry.hpp"

namespace fiducap {

namespace {
constexpr double kLook_s = 2.0;
// Smallest position error of a sighting: drift of the IMU within a look, lens model.
constexpr double kFloor_m = 2e-3;
// Largest residual of a sighting (sigmas of one coordinate): beyond, a wrong id or occluded.
constexpr double kWorstFit = 5.0;
// Tags in a look of which most are right.
constexpr std::size_t kEnoughTags = 3;
// Largest sigma of the gyro bias for a look.
constexpr double kKnownBias_rad_s = 5e-3;
constexpr std::size_t kMostTags = 256;
constexpr std::size_t kFirstTags = 64;

// Priors of the unknowns of a look, 1-sigma.
constexpr double kVelocity_m_s = 10.0;
constexpr double kForce_m_s2 = 1.0;
constexpr double kBias_m_s2 = 0.2;
constexpr double kClock_s = 0.02;
constexpr double kAnywhere_m = 100.0;
constexpr double kAnyKappa = 1e3;

// Smallest relative difference that is reported.
constexpr double kTolerance = 0.05;
constexpr double kSigmas = 5.0;
constexpr double kAgreement = 0.8;
// Largest evidence of one tag (squared sigmas) for or against a common scale, and the evidence of
// all tags that is needed.
constexpr double kMostOfOne = 16.0;
constexpr double kAllEvidence = 20.0;
constexpr double kTagSystematic = 0.02;
// Largest chi-square per degree of freedom, by the IMU (its noise is in kFloor_m) and by the
// filter.
constexpr double kWorstByImu = 6.0;
constexpr double kWorstByOthers = 20.0;
// Change of a logarithmic ratio that is reported again.
constexpr double kChanged = 0.1;

// First columns of the unknowns of a look; blocks of three but for κ and the clock.
namespace column {
constexpr int kKappa = 0;
constexpr int kPlace = 1;     ///< of the tag
constexpr int kLeverArm = 4;  ///< B axes
constexpr int kTurn = 7;      ///< of the camera, V axes
constexpr int kVelocity = 10;
constexpr int kForce = 13;  ///< W axes: tilt, and a bias while the body turns little
constexpr int kBias = 16;   ///< B axes
constexpr int kClock = 19;
}  // namespace column

bool is_beyond(const LogScale& found, const ScaleScore& score) {
  return std::abs(found.value) > std::max(kTolerance, kSigmas * found.sigma) &&
         score.agreement(found.value) >= kAgreement;
}

/// @param reported  0: nothing yet
bool is_old(double value, double reported) {
  return reported != 0 && std::abs(value - reported) < kChanged;
}

double information(double sigma) { return 1 / (sigma * sigma); }

/// Attitude of a tag in the filter's workspace.
const Eigen::Quaterniond* attitude_of(int tag_id, const SizeCheck::Image& image) {
  for (const TagBelief& belief : image.own)
    if (belief.tag.tag_id == tag_id) return &belief.tag.X_WT.q;
  for (const KnownTag& known : image.known)
    if (known.tag_id == tag_id) return &known.X_WT.q;
  return nullptr;
}

/// Position of a tag with known attitude, m, V axes.
struct Sighted {
  Eigen::Vector3d p_VT;
  Eigen::Matrix3d covariance;
};

std::optional<Sighted> locate(const TagObservation& tag, const CameraModel& model,
                              const Eigen::Quaterniond& q_VT, double sigma_px) {
  const Eigen::Vector2d centre =
      (tag.corners_px[0] + tag.corners_px[1] + tag.corners_px[2] + tag.corners_px[3]) / 4;
  const double diagonal_px = (tag.corners_px[2] - tag.corners_px[0]).norm();
  if (!(diagonal_px > 1)) return std::nullopt;
  const double far = std::sqrt(2.0) * tag.edge_m * model.fu / diagonal_px;
  const Eigen::Vector3d start(far * (centre.x() - model.cu) / model.fu,
                              far * (centre.y() - model.cv) / model.fv, far);
  const Pose X_VT = solve_tag_position(tag, model, q_VT, start);
  const CornerResidual fit = corner_residual(tag, X_VT, model);
  if (!fit.in_front || fit.rms_px() > kWorstFit * std::sqrt(2.0) * sigma_px) return std::nullopt;
  const auto H = fit.H.leftCols<3>();
  return Sighted{X_VT.p, sigma_px * sigma_px * Eigen::Matrix3d((H.transpose() * H).inverse())};
}

constexpr double kLarge = 0.3;
constexpr double kSmallAgain = 0.15;
// Fewest tags in ten seconds.
constexpr int kFewest = 50;
constexpr Duration kSecond = std::chrono::seconds(1);
// Most of the seconds must have a large share.
constexpr double kBadSecond = 0.2;
constexpr int kBadSeconds = 7;

double share_of(int rejected, int used) {
  return static_cast<double>(rejected) / std::max(1, rejected + used);
}
}  // namespace

SizeCheck::SizeCheck(BodySensors sensors, double corner_noise_px)
    : sensors_(std::move(sensors)),
      configured_(sensors_.cameras),
      is_learned_(sensors_.cameras.size(), false),
      corner_noise_px_(corner_noise_px),
      motion_(sensors_.imu.value_or(ImuNoise{})) {
  scores_.reserve(kFirstTags);
}

void SizeCheck::add(const ImuSample& imu) {
  if (!sensors_.imu) return;
  motion_.push(imu);
  if (open_ && to_seconds(imu.sampled_at - begun_at_) > 2 * kLook_s)
    finish();  // images have stopped
  if (!open_) motion_.keep_newest();
}

void SizeCheck::add(const Image& image) {
  if (image.report.gauge_shift) others_hold_ = false;
  if (open_ && to_seconds(image.seen.exposed_at - begun_at_) > kLook_s) finish();
  if (image.seen.tags.empty() || image.estimate.at != image.seen.exposed_at) return;
  if (!open_) begin(image);
  if (image.seen.camera != camera_) return;
  if (imu_holds_) imu_holds_ = motion_.move_to(image.seen.exposed_at);
  const auto camera = static_cast<std::size_t>(camera_);
  for (TagObservation tag : image.seen.tags) {
    if (is_learned_[camera] && !undistort_tag(sensors_.cameras[camera].model, tag)) continue;
    look_at(tag, image);
  }
}

void SizeCheck::begin(const Image& image) {
  open_ = true;
  begun_at_ = image.seen.exposed_at;
  camera_ = image.seen.camera;
  p_WB_begin_ = image.estimate.X_WB.p;
  others_hold_ = true;
  // Wrong sizes make a filter restart repeatedly: the last well-known bias stays valid.
  const auto variance = image.estimate.covariance.diagonal().segment<3>(estimate_block::kBiasW);
  if (variance.maxCoeff() < kKnownBias_rad_s * kKnownBias_rad_s) bias_w_ = image.estimate.bias_w;
  imu_holds_ = sensors_.imu && bias_w_;
  if (imu_holds_)
    motion_.restart(begun_at_, image.estimate.X_WB.q, *bias_w_, {0, 0, -sensors_.gravity_m_s2});
  for (Look& look : looks_) {
    look.tag_id = -1;
    look.by_imu.restart();
    look.by_others.restart();
  }
}

SizeCheck::Look* SizeCheck::look_of(const TagObservation& tag, const Image& image,
                                    const Eigen::Quaterniond& q_MV) {
  Look* free = nullptr;
  for (Look& look : looks_) {
    if (look.tag_id == tag.tag_id) return &look;
    if (look.tag_id < 0 && free == nullptr) free = &look;
  }
  if (free == nullptr) return nullptr;
  const Eigen::Quaterniond* q_WT = attitude_of(tag.tag_id, image);
  if (q_WT == nullptr && !(image.own.empty() && image.known.empty())) return nullptr;
  free->tag_id = tag.tag_id;
  free->edge_m = tag.edge_m;
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera_)];
  // A restarting filter reports no tags for seconds. The branch of the planar pose hardly affects
  // the distance.
  free->q_MT = q_WT != nullptr ? q_MV * (image.estimate.X_WB.q * mount.X_BV.q).conjugate() * *q_WT
                               : q_MV * solve_tag_pose(tag, mount.model)[0].X_VT.q;
  return free;
}

void SizeCheck::look_at(const TagObservation& tag, const Image& image) {
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera_)];
  const Eigen::Quaterniond q_MV =
      (imu_holds_ ? motion_.q_WB() : image.estimate.X_WB.q) * mount.X_BV.q;
  Look* look = look_of(tag, image, q_MV);
  if (look == nullptr) return;
  const double sigma_px = std::hypot(corner_noise_px_, tag.corner_sigma_px);
  const auto sighted = locate(tag, mount.model, q_MV.conjugate() * look->q_MT, sigma_px);
  if (!sighted) return;
  const Eigen::Matrix3d covariance =
      sighted->covariance + kFloor_m * kFloor_m * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d weight_V = covariance.inverse();
  const auto put = [&](auto& fit, auto& J, const Eigen::Quaterniond& q_WB,
                       const Eigen::Vector3d& p_WB) {
    const Eigen::Matrix3d R_WB = q_WB.toRotationMatrix();
    const Eigen::Matrix3d R_WV = R_WB * mount.X_BV.rotation();
    J.col(column::kKappa) = -(p_WB + R_WB * mount.X_BV.p);
    J.template middleCols<3>(column::kPlace).setIdentity();
    J.template middleCols<3>(column::kLeverArm) = -R_WB;
    J.template middleCols<3>(column::kTurn) = R_WV * skew(sighted->p_VT);
    fit.add(J, R_WV * sighted->p_VT, R_WV * weight_V * R_WV.transpose());
  };
  if (others_hold_) {
    ScaleFit<kUnknownsByOthers>::Columns J;
    put(look->by_others, J, image.estimate.X_WB.q, image.estimate.X_WB.p - p_WB_begin_);
  }
  if (!imu_holds_) return;
  const double t = motion_.seconds();
  ScaleFit<kUnknownsByImu>::Columns J;
  J.middleCols<3>(column::kVelocity) = -t * Eigen::Matrix3d::Identity();
  J.middleCols<3>(column::kForce) = -0.5 * t * t * Eigen::Matrix3d::Identity();
  J.middleCols<3>(column::kBias) = -motion_.way_by_bias();
  const Eigen::Vector3d p_BT = mount.X_BV * sighted->p_VT;
  J.col(column::kClock) = -(motion_.q_WB() * motion_.rate_B().cross(p_BT) + motion_.speed());
  put(look->by_imu, J, motion_.q_WB(), motion_.way());
}

void SizeCheck::finish() {
  open_ = false;
  const CameraMount& mount = sensors_.cameras[static_cast<std::size_t>(camera_)];
  ScaleFit<kUnknownsByImu>::Vector prior;
  prior << information(kAnyKappa), Eigen::Vector3d::Constant(information(kAnywhere_m)),
      Eigen::Vector3d::Constant(information(std::max(1e-3, mount.position_sigma_m))),
      Eigen::Vector3d::Constant(information(std::max(1e-3, mount.rotation_sigma_rad))),
      Eigen::Vector3d::Constant(information(kVelocity_m_s)),
      Eigen::Vector3d::Constant(information(kForce_m_s2)),
      Eigen::Vector3d::Constant(information(kBias_m_s2)), information(kClock_s);
  compare_with_imu(prior);
  if (others_hold_) compare_with_others(prior.head<kUnknownsByOthers>());
  fresh_ = true;
}

void SizeCheck::compare_with_imu(const ScaleFit<kUnknownsByImu>::Vector& prior) {
  double weights = 0;
  double sum = 0;
  for (const Look& look : looks_) {
    const auto found = look.by_imu.solve(prior, kWorstByImu);
    Score* score = found ? score_of(look) : nullptr;
    if (score == nullptr) continue;
    score->by_imu.add(*found);
    weights += information(found->sigma);
    sum += information(found->sigma) * found->value;
  }
  if (weights > 0) common_.add({sum / weights, 1 / std::sqrt(weights)});
}

void SizeCheck::compare_with_others(const ScaleFit<kUnknownsByOthers>::Vector& prior) {
  std::array<std::optional<LogScale>, kMostAtOnce> found;
  std::array<double, kMostAtOnce> sorted{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < kMostAtOnce; ++i) {
    found[i] = looks_[i].by_others.solve(prior, kWorstByOthers);
    if (found[i]) sorted[count++] = found[i]->value;
  }
  if (count < kEnoughTags) return;
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(count));
  // A wrong tag affects the filter's motion, but equally for all tags.
  const double middle = (sorted[(count - 1) / 2] + sorted[count / 2]) / 2;
  for (std::size_t i = 0; i < kMostAtOnce; ++i) {
    Score* score = found[i] ? score_of(looks_[i]) : nullptr;
    if (score != nullptr) score->by_others.add({found[i]->value - middle, found[i]->sigma});
  }
}

SizeCheck::Score* SizeCheck::score_of(const Look& look) {
  const auto found = std::ranges::find(scores_, look.tag_id, &Score::tag_id);
  if (found != scores_.end()) return &*found;
  if (scores_.size() >= kMostTags) return nullptr;
  scores_.push_back({.tag_id = look.tag_id, .edge_m = look.edge_m});
  return &scores_.back();
}

bool SizeCheck::all_alike(const LogScale& common) const {
  double evidence = 0;
  for (const Score& score : scores_) {
    const auto own = score.by_imu.guess();
    if (!own) continue;
    const double variance = own->sigma * own->sigma + kTagSystematic * kTagSystematic;
    const auto against = [&](double value) {
      return std::min(kMostOfOne, (own->value - value) * (own->value - value) / variance);
    };
    evidence += against(0) - against(common.value);
  }
  return evidence > kAllEvidence;
}

std::optional<LogScale> SizeCheck::verdict_on(const Score& score) const {
  const auto near = score.by_others.result();
  if (near && is_beyond(*near, score.by_others)) return near;
  // The accelerometer counts only for a tag without result relative to the others.
  const auto far = near ? std::nullopt : score.by_imu.result();
  return far && is_beyond(*far, score.by_imu) ? far : std::nullopt;
}

std::optional<SizeFinding> SizeCheck::take_event() {
  if (!fresh_) return std::nullopt;
  fresh_ = false;
  const auto common = common_.result();
  if (common && is_beyond(*common, common_) && all_alike(*common)) {
    if (is_old(common->value, common_reported_)) return std::nullopt;
    common_reported_ = common->value;
    const double ratio = std::exp(common->value);
    return SizeFinding{std::nullopt, 0.0, ratio, ratio * common->sigma};
  }
  Score* worst = nullptr;
  LogScale how{};
  for (Score& score : scores_) {
    const auto found = verdict_on(score);
    if (!found || is_old(found->value, score.reported)) continue;
    if (worst != nullptr && std::abs(found->value) <= std::abs(how.value)) continue;
    worst = &score;
    how = *found;
  }
  if (worst == nullptr) return std::nullopt;
  worst->reported = how.value;
  const double ratio = std::exp(how.value);
  return SizeFinding{worst->tag_id, worst->edge_m, ratio, ratio * how.sigma};
}

std::optional<LogScale> SizeCheck::of_tag(int tag_id, bool by_imu) const {
  for (const Score& score : scores_)
    if (score.tag_id == tag_id) return by_imu ? score.by_imu.result() : score.by_others.result();
  return std::nullopt;
}

std::optional<double> RejectionWatch::add(const UpdateReport& report) {
  if (!begun_at_) begun_at_ = report.exposed_at;
  const Duration since = report.exposed_at - *begun_at_;
  std::optional<double> finding;
  if (since >= kSecond || since < Duration{0}) {
    begun_at_ = report.exposed_at;
    seconds_[full_++ % kSeconds] = now_;
    now_ = {};
    finding = judge();
  }
  now_.used += report.tags_used;
  now_.rejected += report.tags_rejected;
  return finding;
}

std::optional<double> RejectionWatch::judge() {
  if (full_ < kSeconds) return std::nullopt;
  Second sum;
  int bad = 0;
  for (const Second& second : seconds_) {
    sum.used += second.used;
    sum.rejected += second.rejected;
    if (share_of(second.rejected, second.used) > kBadSecond) ++bad;
  }
  const double share = share_of(sum.rejected, sum.used);
  if (share < kSmallAgain) reported_ = false;
  if (reported_ || bad < kBadSeconds || share < kLarge || sum.used + sum.rejected < kFewest)
    return std::nullopt;
  reported_ = true;
  return share;
}

}  // namespace fiducap
