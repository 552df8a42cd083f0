#include "simulation/filter_run.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "pipeline/body_tracker.hpp"
#include "pipeline/doubts.hpp"
#include "pipeline/pose_trust.hpp"
#include "pipeline/replay/bodies_replay.hpp"
#include "support/memory_source.hpp"

namespace fiducap {

Vector6d pose_error(const Pose& estimate, const Pose& truth) {
  Vector6d e;
  e << estimate.p - truth.p, log_so3(estimate.q * truth.q.conjugate());
  return e;
}

double normalised(const Eigen::VectorXd& e, const Eigen::MatrixXd& P) {
  return e.dot(P.ldlt().solve(e));
}

bool may_be_shown(const Matrix15d& P) {
  const BodyLimits limits;
  const auto sigmas = P.diagonal().head<6>().cwiseSqrt();
  return P.diagonal().allFinite() && sigmas.head<3>().maxCoeff() <= limits.max_position_sigma_m &&
         sigmas.tail<3>().maxCoeff() <= limits.max_rotation_sigma_rad;
}

namespace {

/// RMSE of a map's tags; those that the data does not have are left out.
struct MapErrors {
  double position_m{};       ///< In the workspace.
  double near_position_m{};  ///< In the reference tag's axes, without that tag.
  double nees{};             ///< Without it, in the workspace: mean per degree of freedom.
};

/// @param X_WR  room axes → workspace
/// @param X_WT  the reference tag as the map has it
template <typename Tags>
MapErrors map_errors(const Tags& map, const EstimationData& data, const Pose& X_WR,
                     const Pose& X_WT) {
  const Pose X_WT_true = X_WR * data.tag(data.reference_tag)->X_WT;
  MapErrors out;
  int all = 0;
  int others = 0;
  for (const auto& entry : map) {
    const KnownTag& found = entry.tag;
    const RecordedTag* tag = data.tag(found.tag_id);
    if (tag == nullptr) continue;
    const Pose truth = X_WR * tag->X_WT;
    const Vector6d level = pose_error(found.X_WT, truth);
    out.position_m += level.head<3>().squaredNorm();
    ++all;
    if (tag->tag_id == data.reference_tag) continue;
    const Vector6d near = pose_error(X_WT.inverse() * found.X_WT, X_WT_true.inverse() * truth);
    out.near_position_m += near.head<3>().squaredNorm();
    out.nees += normalised(level, found.covariance) / 6;
    ++others;
  }
  out.position_m = std::sqrt(out.position_m / std::max(1, all));
  out.near_position_m = std::sqrt(out.near_position_m / std::max(1, others));
  out.nees /= std::max(1, others);
  return out;
}

// Tags are compared at every tenth image: they hardly move in between.
constexpr int kImagesPerTagCheck = 10;

/// nullopt: the event names no part of the configuration.
std::optional<NamedCause> cause_of(const BodyEvent& event, const BodyPipeline& pipeline) {
  using Kind = BodyEvent::Kind;
  switch (event.kind) {
    case Kind::kMismatch:
      for (const FoundMismatch& found : pipeline.mismatches())
        if (mismatch_text(found, pipeline.setup().sensors.cameras) == event.text)
          return NamedCause{found.kind, found.tag_id, found.is_ambiguous};
      return {};
    case Kind::kTurnsDisagree:  // that of PoseTrust names none
      if (event.text == contradiction_text(true) || event.text == contradiction_text(false))
        return {};
      return NamedCause{event.kind};
    case Kind::kClockJumped:
    case Kind::kImuUnusable:
    case Kind::kImuDoubtful:
      return NamedCause{event.kind};
    default:
      return {};
  }
}

/// Compares one body with the truth, image by image.
class Run {
 public:
  Run(const EstimationData& data, const FilterChoice& choice)
      : data_(data),
        choice_(choice),
        X_WR_(choice.knowledge.map_known() ? Pose{} : workspace_of(data)) {}

  void take(const BodyUpdate& update, const BodyPipeline& pipeline) {
    const Instant first = time_of(data_.samples.front());
    pipeline_ = &pipeline;
    update_ = &update;
    count(update.report);
    close_loop(update.corners);
    for (const BodyEvent& event : update.events) {
      result_.resets += event.kind == BodyEvent::Kind::kReset ? 1 : 0;
      note_said(event.text);
      note_named(event);
    }
    // The filter's, whether it may be shown or not.
    if (!update.has_place()) return;
    const BodyEstimate& estimate = *update.estimate;
    result_.frames_with_pose += update.seen.tags.empty() ? 0 : 1;
    FilterRun::At at = compare(estimate);
    at.t_s = to_seconds(update.seen.exposed_at - first);
    at.has_tags = !update.seen.tags.empty();
    at.nis = update.report.nis;
    at.nis_dof = update.report.nis_dof;
    at.valid &= !update.doubted;
    result_.at.push_back(at);
    if (choice_.watch)
      choice_.watch({at.t_s, pipeline.filter(), estimate, data_.truth_near(estimate.at), X_WR_,
                     update.corners});
  }

  FilterRun finish(const BodyPipeline& pipeline) {
    result_.clock = pipeline.filter().clock(0);
    result_.seconds = to_seconds(time_of(data_.samples.back()) - time_of(data_.samples.front()));
    finish_map(pipeline.filter());
    for (const std::string& doubt : pipeline.doubts()) note_said(doubt);
    return std::move(result_);
  }

  [[nodiscard]] const Pose& X_WR() const { return X_WR_; }

 private:
  [[nodiscard]] const RecordedTag& reference() const { return *data_.tag(data_.reference_tag); }

  void note_said(const std::string& text) {
    const bool known =
        std::find(result_.said.begin(), result_.said.end(), text) != result_.said.end();
    if (!text.empty() && !known) result_.said.push_back(text);
  }

  void note_named(const BodyEvent& event) {
    const auto cause = cause_of(event, *pipeline_);
    if (cause && std::ranges::find(result_.named, *cause) == result_.named.end())
      result_.named.push_back(*cause);
  }

  void count(const UpdateReport& report) {
    ++result_.frames;
    result_.frames_with_tags += update_->seen.tags.empty() ? 0 : 1;
    result_.nis += report.nis;
    result_.nis_dof += report.nis_dof;
    result_.tags_rejected += report.tags_rejected;
    result_.tags_used += report.tags_used;
    result_.tags_dropped += report.tags_dropped;
    result_.landmarks_used += report.landmarks_used;
    result_.landmark_nis += report.landmark_nis;
    result_.landmark_nis_dof += report.landmark_nis_dof;
  }

  void close_loop(const CornerFrame& corners) {
    if (!shows(corners, data_.reference_tag)) return;
    const bool returns =
        reference_seen_ && to_seconds(corners.exposed_at - *reference_seen_) > kAway_s;
    if (returns && result_.gap_path_m == 0 && !result_.at.empty()) {
      result_.gap_m = result_.at.back().position_m;
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
    at.valid = may_be_shown(P);
    const int n = data_.imu ? 15 : 9;
    at.nees.whole = normalised(e.head(n), P.topLeftCorner(n, n));
    at.nees.pose = normalised(e.head<6>(), P.topLeftCorner<6, 6>());
    at.nees.velocity = normalised(e.segment<3>(6), P.block<3, 3>(6, 6));
    if (data_.imu) at.nees.biases = normalised(e.tail<6>(), P.bottomRightCorner<6, 6>());
    if (!choice_.knowledge.extrinsics_known()) {
      const ExtrinsicsEstimate found = pipeline_->cameras().front();
      at.nees.extrinsics = normalised(pose_error(found.X_BV, data_.camera.X_BV), found.covariance);
    }
    compare_to_tags(estimate, X_WB, at);
    return at;
  }

  /// Errors relative to the tags of the filter's state.
  void compare_to_tags(const BodyEstimate& estimate, const Pose& X_WB, FilterRun::At& at) {
    at.position_m = at.level_position_m;
    at.rotation_rad = at.level_rotation_rad;
    if (choice_.knowledge.map_known()) return;
    beliefs_ = update_->beliefs;
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

  void finish_map(const BodyFilter& filter) {
    filter.tag_beliefs(beliefs_);
    result_.tags_mapped = static_cast<int>(beliefs_.size());
    const MapErrors errors =
        map_errors(beliefs_, data_, X_WR_, seen_reference(X_WR_ * reference().X_WT));
    result_.map_position_m = errors.position_m;
    result_.near_map_position_m = errors.near_position_m;
  }

  const EstimationData& data_;
  FilterChoice choice_;
  Pose X_WR_;
  const BodyPipeline* pipeline_{nullptr};
  const BodyUpdate* update_{nullptr};
  std::vector<TagBelief> beliefs_;
  std::optional<Pose> last_reference_;
  std::optional<Instant> reference_seen_;
  FilterRun result_;
};

TagMap start_map(const EstimationData& data, const FilterChoice& choice) {
  if (choice.start) return *choice.start;
  TagMap map;
  if (!choice.knowledge.map_known()) {
    map.reference_tag = data.reference_tag;
    return map;
  }
  for (const RecordedTag& tag : data.tags)
    map.tags.push_back(
        {{tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()}, TagState::kSurveyed, 0, 0, 0, 0});
  return map;
}

}  // namespace

Pose workspace_of(const EstimationData& data) {
  const Pose& X_RT = data.tag(data.reference_tag)->X_WT;
  if (!data.imu) return X_RT.inverse();
  const Eigen::Vector3d h = X_RT.q * Eigen::Vector3d::Unit(bound::heading_axis(X_RT.q));
  const Eigen::Quaterniond turn = exp_so3({0, 0, -std::atan2(h.y(), h.x())});
  return {turn, -(turn * X_RT.p)};
}

PipelineSetup pipeline_of(const EstimationData& data, const FilterChoice& choice) {
  PipelineSetup setup;
  setup.sensors.cameras = {data.camera};
  if (!choice.knowledge.extrinsics_known()) setup.sensors.cameras.front().X_BV = data.nominal_X_BV;
  setup.sensors.imu = data.imu;
  setup.sensors.gravity_m_s2 = data.gravity_m_s2;
  setup.sensors.gravity_sigma_m_s2 = data.gravity_sigma_m_s2;
  setup.tags = data.tag_set;
  setup.estimator = choice.estimator;
  setup.estimator.corner_noise_px = data.corner_noise_px;
  setup.estimator.estimate_extrinsics = !choice.knowledge.extrinsics_known();
  if (!choice.knowledge.map_known()) setup.gauge.reference_tag = data.reference_tag;
  setup.filter = choice.filter;
  // The time of a pose without a tag is a limit of the live path; without it, the filter alone
  // decides when the motion is lost.
  constexpr double kNever_s = 1e6;
  if (!choice.live) setup.lose_after_s = kNever_s;
  return setup;
}

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

TogetherRun run_together(std::span<const EstimationData> data, const FilterChoice& choice) {
  std::vector<MemorySource> sources;
  std::vector<Run> runs;
  for (const EstimationData& one : data) {
    sources.emplace_back(one.samples);
    runs.emplace_back(one, choice);
  }
  std::vector<ReplayedBody> bodies;
  for (std::size_t i = 0; i < data.size(); ++i)
    bodies.push_back(
        {static_cast<int>(i) + 1, data[i].name, pipeline_of(data[i], choice), &sources[i]});
  MapConfig map;
  map.mode = choice.live && !choice.frozen ? MapMode::kMapping : MapMode::kFrozen;
  map.refine_period_s = choice.refine_period_s;
  BodiesReplay replay(std::move(bodies), map, start_map(data.front(), choice));
  TogetherRun out;
  const auto done = replay.run([&](std::size_t body, const BodyUpdate& update) {
    runs[body].take(update, replay.pipeline(body));
    for (MapEvent& event : replay.map().take_events()) {
      out.map_events.push_back(std::move(event));
      if (choice.hear) choice.hear(out.map_events.back(), update.seen.exposed_at);
    }
    if (choice.listen) choice.listen(body, update, *replay.view().map);
  });
  FIDUCAP_ASSERT(done.has_value());
  for (std::size_t i = 0; i < runs.size(); ++i)
    out.bodies.push_back(runs[i].finish(replay.pipeline(i)));
  out.map = *replay.map().snapshot();
  const MapErrors errors = map_errors(out.map.tags, data.front(), runs.front().X_WR(), Pose{});
  out.map_position_m = errors.position_m;
  out.map_nees = errors.nees;
  return out;
}

FilterRun run_filter(const EstimationData& data, const FilterChoice& choice) {
  return run_together(std::span(&data, 1), choice).bodies.front();
}

}  // namespace fiducap
