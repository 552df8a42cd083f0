#include "simulation/filter_run.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>
#include <random>

#include "base/so3.hpp"
#include "capture/sample_merger.hpp"
#include "detection/observe.hpp"
#include "estimation/heading_rule.hpp"

namespace fiducap {

namespace {

constexpr Instant kStart = instant_from_ns(1'000'000'000);

CameraMount true_camera() {
  CameraMount mount;
  mount.model.width = 752;
  mount.model.height = 480;
  mount.model.fu = mount.model.fv = 460;
  mount.model.cu = 376;
  mount.model.cv = 240;
  mount.X_BV = simulation::forward_camera();
  mount.position_sigma_m = 0.005;
  mount.rotation_sigma_rad = 0.00873;
  return mount;
}

CameraMount nominal_camera(std::uint64_t seed) {
  CameraMount mount = true_camera();
  std::mt19937_64 random(seed * 77 + 5);
  std::normal_distribution<double> gauss;
  const auto draw = [&](double sigma) { return Eigen::Vector3d(sigma * gauss(random), sigma * gauss(random), sigma * gauss(random)); };
  mount.X_BV.p += draw(mount.position_sigma_m);
  mount.X_BV.q = exp_so3(draw(mount.rotation_sigma_rad)) * mount.X_BV.q;
  return mount;
}

/// Room axes → the workspace that a filter ties to its reference tag.
Pose workspace_of(const Pose& X_RT, bool level) {
  if (!level) return X_RT.inverse();
  const auto rule = make_heading_rule({}, X_RT.q);
  const Eigen::Vector3d h = X_RT.q * Eigen::Vector3d::Unit(rule.axis);
  const Eigen::Quaterniond turn = exp_so3({0, 0, -std::atan2(h.y(), h.x())});
  return {turn, -(turn * X_RT.p)};
}

double rms(const std::vector<FilterRun::At>& all, const std::function<double(const FilterRun::At&)>& of) {
  double sum = 0;
  for (const auto& at : all) sum += of(at) * of(at);
  return std::sqrt(sum / static_cast<double>(all.size()));
}

FilterRun::At compare(const BodyEstimate& estimate, const TruthSample& truth, const Pose& X_WR, bool has_imu) {
  const Pose X_WB = X_WR * truth.X_WB;
  Eigen::Matrix<double, 15, 1> e;
  e << estimate.X_WB.p - X_WB.p, log_so3(estimate.X_WB.q * X_WB.q.conjugate()),
      estimate.v_WB - X_WR.q * truth.v_WB, estimate.bias_f - truth.bias_f, estimate.bias_w - truth.bias_w;
  const int n = has_imu ? 15 : 9;
  FilterRun::At at;
  at.position_m = e.head<3>().norm();
  at.rotation_rad = e.segment<3>(3).norm();
  at.velocity_m_s = e.segment<3>(6).norm();
  const Eigen::MatrixXd P = estimate.covariance.topLeftCorner(n, n);
  const Eigen::VectorXd head = e.head(n);
  at.nees = head.dot(P.ldlt().solve(head));
  return at;
}

class Run {
 public:
  explicit Run(const FilterRunSetup& setup) : setup_(setup) {
    room_.preset = setup.world;
    body_.cameras = {true_camera()};
    body_.has_imu = setup.has_imu;
    body_.camera.images = false;
    body_.trajectory.kind = setup.world == "hall" ? "survey" : setup.world;
    body_.trajectory.seed = setup.seed;
    body_.trajectory.duration_s = 0;
    body_.faults = setup.faults;
    body_.seed = setup.seed;
  }

  FilterRun go() {
    auto source = simulation::make_simulated_source(room_, body_, kStart, nullptr);
    if (!source) throw std::runtime_error(source.error().text());
    tags_ = simulation::tags_of(room_);
    BodySensors sensors;
    sensors.cameras = {setup_.true_extrinsics ? true_camera() : nominal_camera(setup_.seed)};
    if (setup_.has_imu) sensors.imu = body_.imu.noise;
    EstimatorConfig config = setup_.estimator;
    config.estimate_extrinsics = !setup_.true_extrinsics;
    // Without IMU nothing tells extrinsics from pose: they are taken as given.
    if (!setup_.has_imu) config.estimate_extrinsics = false;
    filter_ = make_body_filter(setup_.filter, sensors, {}, config);
    if (setup_.known_map) {
      for (const RecordedTag& tag : tags_) known_.push_back({tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()});
    }
    set_.family = room_.family;
    for (const RecordedTag& tag : tags_) set_.sizes_m[tag.tag_id] = tag.edge_m;

    SampleMerger merger({setup_.has_imu, std::chrono::milliseconds(250), 8, 4096});
    const Instant end = kStart + from_seconds(setup_.seconds);
    for (;;) {
      auto sample = (*source)->next({});
      if (!sample) throw std::runtime_error(sample.error().text());
      if (!sample->has_value() || time_of(**sample) > end) break;
      merger.push(std::move(**sample));
      while (auto merged = merger.pop()) take(*merged, **source);
    }
    finish_map();
    return result_;
  }

 private:
  void take(const SensorSample& sample, const simulation::SimulatedSource& source) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) return filter_->propagate(*imu);
    const auto* corners = std::get_if<CornerFrame>(&sample);
    if (corners == nullptr) return;
    observe(*corners, true_camera().model, set_, {}, seen_);
    const UpdateReport report = filter_->update(seen_, known_);
    ++result_.frames;
    result_.nis += report.nis;
    result_.nis_dof += report.nis_dof;
    result_.tags_rejected += report.tags_rejected;
    result_.tags_used += report.tags_used;
    result_.tags_dropped += report.tags_dropped;
    const bool has_tags = !seen_.tags.empty();
    result_.frames_with_tags += has_tags ? 1 : 0;
    if (!filter_->running()) return;
    const BodyEstimate estimate = filter_->estimate();
    if (!estimate.anchored || estimate.at != seen_.exposed_at) return;
    result_.frames_with_pose += has_tags ? 1 : 0;
    if (!X_WR_) X_WR_ = setup_.known_map ? Pose{} : workspace_of(reference_pose(), setup_.has_imu);
    FilterRun::At at = compare(estimate, source.truth(seen_.exposed_at), *X_WR_, setup_.has_imu);
    at.t_s = to_seconds(seen_.exposed_at - kStart);
    if (at.t_s >= setup_.scored_after_s) result_.scored.push_back(at);
  }

  /// The tag that the filter chose: the one whose place it holds exact.
  Pose reference_pose() {
    std::vector<TagBelief> beliefs;
    filter_->tag_beliefs(beliefs);
    const TagBelief* best = nullptr;
    for (const TagBelief& b : beliefs) {
      if (best == nullptr || b.tag.covariance.topLeftCorner<3, 3>().trace() < best->tag.covariance.topLeftCorner<3, 3>().trace()) {
        best = &b;
      }
    }
    return truth_of(best->tag.tag_id).value();
  }

  /// nullopt: a wrong id, no such tag is in the room.
  std::optional<Pose> truth_of(int tag_id) const {
    for (const RecordedTag& tag : tags_) {
      if (tag.tag_id == tag_id) return tag.X_WT;
    }
    return std::nullopt;
  }

  void finish_map() {
    std::vector<TagBelief> beliefs;
    filter_->tag_beliefs(beliefs);
    double sum = 0;
    for (const TagBelief& b : beliefs) {
      if (const auto truth = truth_of(b.tag.tag_id)) sum += (b.tag.X_WT.p - (*X_WR_ * *truth).p).squaredNorm();
    }
    result_.tags_mapped = static_cast<int>(beliefs.size());
    if (!beliefs.empty()) result_.map_position_m = std::sqrt(sum / static_cast<double>(beliefs.size()));
  }

  FilterRunSetup setup_;
  simulation::RoomConfig room_;
  simulation::SimulatedBodyConfig body_;
  std::vector<RecordedTag> tags_;
  std::vector<KnownTag> known_;
  TagSetConfig set_;
  TagObservations seen_;
  std::unique_ptr<BodyFilter> filter_;
  std::optional<Pose> X_WR_;
  FilterRun result_;
};

}  // namespace

double FilterRun::position_rmse_m() const { return rms(scored, [](const At& a) { return a.position_m; }); }
double FilterRun::rotation_rmse_rad() const { return rms(scored, [](const At& a) { return a.rotation_rad; }); }
double FilterRun::velocity_rmse_m_s() const { return rms(scored, [](const At& a) { return a.velocity_m_s; }); }
double FilterRun::mean_nees() const {
  double sum = 0;
  for (const At& at : scored) sum += at.nees;
  return sum / static_cast<double>(scored.size());
}

FilterRun run_filter(const FilterRunSetup& setup) { return Run(setup).go(); }

}  // namespace fiducap
