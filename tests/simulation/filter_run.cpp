#include "simulation/filter_run.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/cpu_time.hpp"
#include "base/so3.hpp"
#include "capture/sample_merger.hpp"
#include "detection/observe.hpp"

namespace fiducap {

namespace {

// Tags are compared at every tenth image: they hardly move in between.
constexpr int kImagesPerTagCheck = 10;

/// Room axes → the workspace that a filter ties to its reference tag.
Pose workspace_of(const Pose& X_RT, bool level) {
  if (!level) return X_RT.inverse();
  const Eigen::Vector3d h = X_RT.q * Eigen::Vector3d::Unit(bound::heading_axis(X_RT.q));
  const Eigen::Quaterniond turn = exp_so3({0, 0, -std::atan2(h.y(), h.x())});
  return {turn, -(turn * X_RT.p)};
}

Eigen::Matrix<double, 6, 1> pose_error(const Pose& estimate, const Pose& truth) {
  Eigen::Matrix<double, 6, 1> e;
  e << estimate.p - truth.p, log_so3(estimate.q * truth.q.conjugate());
  return e;
}

/// eᵀ P⁻¹ e
double normalised(const Eigen::VectorXd& e, const Eigen::MatrixXd& P) {
  return e.dot(P.ldlt().solve(e));
}

class Run {
 public:
  Run(const EstimationData& data, const FilterChoice& choice)
      : data_(data),
        choice_(choice),
        X_WR_(choice.knowledge.map_known() ? Pose{}
                                           : workspace_of(reference().X_WT, data.imu.has_value())) {
    BodySensors sensors;
    sensors.cameras = {data.camera};
    if (!choice.knowledge.extrinsics_known()) sensors.cameras.front().X_BV = data.nominal_X_BV;
    sensors.imu = data.imu;
    sensors.gravity_m_s2 = data.gravity_m_s2;
    EstimatorConfig config = choice.estimator;
    config.corner_noise_px = data.corner_noise_px;
    config.estimate_extrinsics = !choice.knowledge.extrinsics_known();
    if (choice.knowledge.map_known()) {
      for (const RecordedTag& tag : data.tags)
        known_.push_back({tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()});
    }
    WorkspaceGauge gauge;
    if (!choice.knowledge.map_known()) gauge.reference_tag = data.reference_tag;
    filter_ = make_body_filter(choice.filter, sensors, gauge, config);
  }

  FilterRun go() {
    const Instant first = time_of(data_.samples.front());
    SampleMerger merger({.has_imu = data_.imu.has_value()});
    const auto drain = [&] {
      while (const auto sample = merger.pop()) take(*sample, first, merger);
    };
    for (const SensorSample& sample : data_.samples) {
      merger.push(sample);
      drain();
    }
    merger.finish();
    drain();
    result_.clock = filter_->clock(0);
    result_.seconds = to_seconds(time_of(data_.samples.back()) - first);
    finish_map();
    return std::move(result_);
  }

 private:
  [[nodiscard]] const RecordedTag& reference() const { return *data_.tag(data_.reference_tag); }

  void take(const SensorSample& sample, Instant first, SampleMerger& merger) {
    if (const auto* imu = std::get_if<ImuSample>(&sample)) {
      const Duration begin = thread_cpu_time();
      filter_->propagate(*imu);
      result_.propagate_cpu_s += to_seconds(thread_cpu_time() - begin);
      return;
    }
    const auto& corners = std::get<CornerFrame>(sample);
    image(corners, first);
    merger.set_clock_shift(corners.camera,
                           shift_to_apply(filter_->clock(corners.camera), corners.clock_shift));
  }

  void image(const CornerFrame& corners, Instant first) {
    observe(corners, data_.camera.model, data_.tag_set, {}, seen_);
    const UpdateReport report = update();
    count(report);
    close_loop(corners);
    if (!filter_->running()) return;
    const BodyEstimate estimate = filter_->estimate();
    if (!estimate.anchored || estimate.at != seen_.exposed_at) return;
    result_.frames_with_pose += seen_.tags.empty() ? 0 : 1;
    FilterRun::At at = compare(estimate);
    at.t_s = to_seconds(seen_.exposed_at - first);
    at.has_tags = !seen_.tags.empty();
    at.nis = report.nis;
    at.nis_dof = report.nis_dof;
    result_.at.push_back(at);
    if (choice_.watch)
      choice_.watch({at.t_s, *filter_, estimate, data_.truth_near(estimate.at), X_WR_, corners});
  }

  UpdateReport update() {
    Duration begin = thread_cpu_time();
    if (choice_.split_cost) {
      nothing_.exposed_at = seen_.exposed_at;
      (void)filter_->update(nothing_, {});
      const Duration moved = thread_cpu_time();
      result_.propagate_cpu_s += to_seconds(moved - begin);
      begin = moved;
    }
    const UpdateReport report = filter_->update(seen_, {known_});
    result_.update_cpu_s += to_seconds(thread_cpu_time() - begin);
    return report;
  }

  void count(const UpdateReport& report) {
    ++result_.frames;
    result_.frames_with_tags += seen_.tags.empty() ? 0 : 1;
    result_.nis += report.nis;
    result_.nis_dof += report.nis_dof;
    result_.tags_rejected += report.tags_rejected;
    result_.tags_used += report.tags_used;
    result_.tags_dropped += report.tags_dropped;
    result_.landmarks_used += report.landmarks_used;
    result_.landmarks_rejected += report.landmarks_rejected;
    result_.landmark_nis += report.landmark_nis;
    result_.landmark_nis_dof += report.landmark_nis_dof;
  }

  void close_loop(const CornerFrame& corners) {
    const bool sees =
        std::any_of(corners.tags.begin(), corners.tags.end(),
                    [&](const TagSighting& t) { return t.tag_id == data_.reference_tag; });
    if (!sees) return;
    const bool returns =
        reference_seen_ && to_seconds(corners.exposed_at - *reference_seen_) > kAway_s;
    if (returns && result_.gap_path_m == 0 && !result_.at.empty()) {
      result_.gap_m = result_.at.back().position_m;
      result_.gap_rotation_rad = result_.at.back().rotation_rad;
      result_.gap_path_m = data_.path_m(corners.exposed_at);
      result_.gap_t_s = to_seconds(corners.exposed_at - time_of(data_.samples.front()));
    }
    reference_seen_ = corners.exposed_at;
  }

  FilterRun::At compare(const BodyEstimate& estimate) {
    const TruthSample truth = data_.truth_near(estimate.at);
    const Pose X_WB = X_WR_ * truth.X_WB;
    Eigen::Matrix<double, 15, 1> e;
    e << pose_error(estimate.X_WB, X_WB), estimate.v_WB - X_WR_.q * truth.v_WB,
        estimate.bias_f - truth.bias_f, estimate.bias_w - truth.bias_w;
    FilterRun::At at;
    at.level_position_m = e.head<3>().norm();
    at.level_rotation_rad = e.segment<3>(3).norm();
    at.velocity_m_s =
        (estimate.X_WB.q.conjugate() * estimate.v_WB - truth.X_WB.q.conjugate() * truth.v_WB)
            .norm();
    at.rate_rad_s = (estimate.w_WB_B - data_.rate_at(estimate.at)).norm();
    at.sigma_m = std::sqrt(estimate.covariance.topLeftCorner<3, 3>().trace());
    const Matrix15d& P = estimate.covariance;
    const int n = data_.imu ? 15 : 9;
    at.nees.whole = normalised(e.head(n), P.topLeftCorner(n, n));
    at.nees.pose = normalised(e.head<6>(), P.topLeftCorner<6, 6>());
    at.nees.velocity = normalised(e.segment<3>(6), P.block<3, 3>(6, 6));
    if (data_.imu) at.nees.biases = normalised(e.tail<6>(), P.bottomRightCorner<6, 6>());
    if (!choice_.knowledge.extrinsics_known()) {
      const ExtrinsicsEstimate found = filter_->extrinsics().front();
      at.nees.extrinsics = normalised(pose_error(found.X_BV, data_.camera.X_BV), found.covariance);
    }
    compare_to_tags(estimate, X_WB, at);
    return at;
  }

  /// What needs the tags of the filter's state.
  void compare_to_tags(const BodyEstimate& estimate, const Pose& X_WB, FilterRun::At& at) {
    at.position_m = at.level_position_m;
    at.rotation_rad = at.level_rotation_rad;
    if (choice_.knowledge.map_known()) return;
    filter_->tag_beliefs(beliefs_);
    const Pose X_WT = X_WR_ * reference().X_WT;
    const Pose X_WT_seen = seen_reference(X_WT);
    const auto e = pose_error(X_WT_seen.inverse() * estimate.X_WB, X_WT.inverse() * X_WB);
    at.position_m = e.head<3>().norm();
    at.rotation_rad = e.tail<3>().norm();
    if (result_.frames % kImagesPerTagCheck != 0) return;
    double sum = 0;
    int tags = 0;
    for (const TagBelief& belief : beliefs_) {
      const RecordedTag* tag = data_.tag(belief.tag.tag_id);
      if (tag == nullptr || tag->tag_id == data_.reference_tag) continue;
      sum += normalised(pose_error(belief.tag.X_WT, X_WR_ * tag->X_WT), belief.tag.covariance);
      ++tags;
    }
    if (tags > 0) at.nees.tags = sum / tags;
  }

  /// The reference tag as the filter holds it, or held it last.
  Pose seen_reference(const Pose& X_WT_true) {
    for (const TagBelief& belief : beliefs_) {
      if (belief.tag.tag_id == data_.reference_tag) last_reference_ = belief.tag.X_WT;
    }
    return last_reference_.value_or(X_WT_true);
  }

  void finish_map() {
    filter_->tag_beliefs(beliefs_);
    result_.tags_mapped = static_cast<int>(beliefs_.size());
    const Pose X_WT = X_WR_ * reference().X_WT;
    const Pose X_WT_seen = seen_reference(X_WT);
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    int tags = 0;
    int others = 0;
    for (const TagBelief& belief : beliefs_) {
      const RecordedTag* tag = data_.tag(belief.tag.tag_id);
      if (tag == nullptr) continue;
      const Pose truth = X_WR_ * tag->X_WT;
      const auto level = pose_error(belief.tag.X_WT, truth);
      const auto near = pose_error(X_WT_seen.inverse() * belief.tag.X_WT, X_WT.inverse() * truth);
      sum += Eigen::Vector4d(level.head<3>().squaredNorm(), level.tail<3>().squaredNorm(),
                             near.head<3>().squaredNorm(), near.tail<3>().squaredNorm());
      ++tags;
      others += tag->tag_id == data_.reference_tag ? 0 : 1;
    }
    if (tags == 0) return;
    result_.map_position_m = std::sqrt(sum(0) / tags);
    result_.map_rotation_rad = std::sqrt(sum(1) / tags);
    if (others == 0) return;
    result_.near_map_position_m = std::sqrt(sum(2) / others);
    result_.near_map_rotation_rad = std::sqrt(sum(3) / others);
  }

  const EstimationData& data_;
  FilterChoice choice_;
  Pose X_WR_;
  std::vector<KnownTag> known_;
  TagObservations seen_;
  TagObservations nothing_;
  std::unique_ptr<BodyFilter> filter_;
  std::vector<TagBelief> beliefs_;
  std::optional<Pose> last_reference_;
  std::optional<Instant> reference_seen_;
  FilterRun result_;
};

}  // namespace

FilterRun FilterRun::scored_after(double t_s) const {
  FilterRun out = *this;
  std::erase_if(out.at, [&](const At& a) { return a.t_s < t_s; });
  return out;
}

double FilterRun::rms(const std::function<double(const At&)>& of) const {
  return std::sqrt(mean([&](const At& a) { return of(a) * of(a); }));
}

double FilterRun::mean(const std::function<double(const At&)>& of) const {
  double sum = 0;
  int count = 0;
  for (const At& a : at) {
    const double value = of(a);
    if (std::isnan(value)) continue;
    sum += value;
    ++count;
  }
  return count == 0 ? Nees::kNone : sum / count;
}

FilterRun run_filter(const EstimationData& data, const FilterChoice& choice) {
  return Run(data, choice).go();
}

}  // namespace fiducap
