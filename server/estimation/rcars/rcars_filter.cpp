#include "estimation/rcars/rcars_filter.hpp"

#include <algorithm>
#include <utility>

#include "base/expected.hpp"
#include "estimation/filter/chi_square.hpp"

namespace fiducap::rcars {

namespace {
// Initial uncertainty, 1-sigma.
constexpr double kStartTilt_rad = 0.1;
constexpr double kStartBiasF_m_s2 = 0.2;
constexpr double kStartBiasW_rad_s = 0.02;
// Rotation and force change little within a step.
constexpr double kLongestStep_s = 0.02;
// Views of a tag before it joins, and after which a branch is taken with little evidence when there
// is no other tag.
constexpr int kViewsToJoin = 3;
constexpr int kViewsToForce = 40;
// Time without a fitting tag after which a contradicting image restarts the filter.
constexpr double kRestartAfter_s = 10.0;
}  // namespace

RcarsFilter::RcarsFilter(BodySensors sensors, WorkspaceGauge gauge, const EstimatorConfig& config)
    : sensors_(std::move(sensors)),
      gauge_(std::move(gauge)),
      config_(config),
      g_W_(0, 0, -sensors_.gravity_m_s2),
      gate_(chi_square_quantile(8, config.gate_probability)),
      imu_(sensors_.imu.value_or(ImuNoise{}), config.max_imu_gap_s, config.motion_accel_m_s2_rtHz),
      candidates_(config) {
  FIDUCAP_ASSERT(sensors_.imu && !sensors_.cameras.empty());  // by the rules of the configuration
  restart();
}

void RcarsFilter::restart() {
  ++generation_;
  is_started_ = is_anchored_ = false;
  defined_by_.reset();
  candidates_.forget_all();
  attitude_.restart();
  x_ = {};
  for (const CameraMount& camera : sensors_.cameras) x_.cameras.push_back(camera.X_BV);
  x_.P = Eigen::MatrixXd::Zero(x_.size(), x_.size());
  for (std::size_t c = 0; config_.estimate_extrinsics && c < x_.cameras.size(); ++c) {
    const CameraMount& camera = sensors_.cameras[c];
    auto variances = x_.P.diagonal().segment<6>(x_.camera_at(static_cast<int>(c)));
    variances.head<3>().setConstant(camera.position_sigma_m * camera.position_sigma_m);
    variances.tail<3>().setConstant(camera.rotation_sigma_rad * camera.rotation_sigma_rad);
  }
}

void RcarsFilter::start(Instant at) {
  is_started_ = true;
  last_fit_ = at;
  x_.time = at;
  x_.q = attitude_.q_WB(at, x_.b_w);
  const Eigen::Vector3d up_B = x_.q.conjugate() * Eigen::Vector3d::UnitZ();
  x_.P.block<3, 3>(kQ, kQ) =
      kStartTilt_rad * kStartTilt_rad * (Eigen::Matrix3d::Identity() - up_B * up_B.transpose());
  auto variances = x_.P.diagonal();
  variances.segment<3>(kV).setConstant(kStartVelocity_m_s * kStartVelocity_m_s);
  variances.segment<3>(kBf).setConstant(kStartBiasF_m_s2 * kStartBiasF_m_s2);
  variances.segment<3>(kBw).setConstant(kStartBiasW_rad_s * kStartBiasW_rad_s);
}

void RcarsFilter::propagate(const ImuSample& imu) {
  const std::optional<ImuSample> before = imu_.newest();
  if (!imu_.push(imu)) return;
  if (before) attitude_.add(*before, x_.b_w, x_.b_f);
  if (!is_started_) {
    imu_.keep_newest_pair();
  } else if (imu_.is_full()) {  // no image for long
    predict(imu_.before_newest().sampled_at);
  }
}

void RcarsFilter::predict(Instant to) {
  Prediction prediction(x_);
  while (x_.time < to) {
    const Instant end =
        std::min(imu_.end_of_interval(x_.time, to), x_.time + from_seconds(kLongestStep_s));
    prediction.step(x_, imu_.input_between(x_.time, end), g_W_, to_seconds(end - x_.time));
    x_.time = end;
  }
  prediction.finish(x_);
  imu_.forget_before(to);
}

UpdateReport RcarsFilter::update(const TagObservations& seen, const MapKnowledge& map) {
  UpdateReport report;
  report.exposed_at = seen.exposed_at;
  report.tags_seen = static_cast<int>(seen.tags.size());
  report.generation = generation_;
  report.running = running();
  if (is_started_ && seen.exposed_at < x_.time) return report;  // late
  if (is_started_ && seen.exposed_at > x_.time) predict(seen.exposed_at);
  if (is_started_ && !is_anchored_) define_workspace(map);

  const View view{seen.camera, sensors_.cameras[static_cast<std::size_t>(seen.camera)].model,
                  config_.corner_noise_px};
  std::vector<Sighting> usable;
  std::vector<Sighting> fresh;
  for (const TagObservation& tag : seen.tags) {
    const bool is_own = x_.find(tag.tag_id).has_value();
    const auto known = std::ranges::find(map.tags, tag.tag_id, &KnownTag::tag_id);
    const bool is_given = !is_own && known != map.tags.end();
    const Sighting sighting{&tag, is_given ? &*known : nullptr};
    (is_own || (is_given && is_anchored_) ? usable : fresh).push_back(sighting);
  }
  if (!usable.empty()) correct(view, usable, seen.exposed_at, report);
  const bool fits = usable.empty() || report.tags_used > 0;
  if (!fits && to_seconds(seen.exposed_at - last_fit_) > kRestartAfter_s) {
    restart();
  } else {
    join(seen, view, fresh, usable.empty(), map, report);
    define_workspace(map);
  }
  const bool has_restarted = std::exchange(report.generation, generation_) != generation_;
  report.gauge_shift = has_restarted ? std::nullopt : gauge_shift_;
  gauge_shift_.reset();
  report.running = running();
  return report;
}

void RcarsFilter::correct(const View& view, const std::vector<Sighting>& tags, Instant at,
                          UpdateReport& report) {
  const std::vector<bool> used = rcars::update(x_, view, tags, gate_, report);
  if (report.tags_used > 0) last_fit_ = at;
  for (std::size_t i = 0; i < tags.size(); ++i) {
    if (!used[i] || tags[i].known != nullptr) continue;
    Tag& tag = x_.tags[*x_.find(tags[i].seen->tag_id)];
    ++tag.sightings;
    tag.last_seen = at;
  }
}

void RcarsFilter::join(const TagObservations& seen, const View& view,
                       const std::vector<Sighting>& tags, bool is_alone, const MapKnowledge& map,
                       UpdateReport& report) {
  if (!attitude_.ready()) return;
  const Instant at = seen.exposed_at;
  const CameraAttitude attitude{attitude_.q_LB(at, x_.b_w) *
                                x_.cameras[static_cast<std::size_t>(view.camera)].q};
  std::vector<std::pair<Sighting, Pose>> decided;
  for (const Sighting& tag : tags) {
    const auto verdict = candidates_.judge(view.camera, at, *tag.seen, view.model, view.noise_px,
                                           attitude, {kViewsToJoin, is_alone ? kViewsToForce : 0});
    if (verdict) decided.emplace_back(tag, verdict->X_VT);
    report.tags_pending += verdict ? 0 : 1;
  }
  for (const auto& [tag, X_VT] : decided) {
    if (!is_started_) start(at);
    if (tag.known != nullptr) {
      if (!is_anchored_) moved_workspace(define_by_known(x_, view.camera, X_VT, tag.known->X_WT));
      correct(view, {tag}, at, report);
    } else if (static_cast<int>(x_.tags.size()) < config_.max_local_tags) {
      join_state(*tag.seen, view, X_VT, at, map.may_define_workspace);
      ++report.tags_added;
    }
  }
}

void RcarsFilter::join_state(const TagObservation& seen, const View& view, const Pose& X_VT,
                             Instant at, bool may_define) {
  augment(x_, view, seen, X_VT);
  last_fit_ = x_.tags.back().first_seen = x_.tags.back().last_seen = at;
  const auto prior = priors_.find(seen.tag_id);
  if (prior == priors_.end() || !(is_anchored_ || may_define)) return;
  if (!is_anchored_) moved_workspace(define_by_known(x_, view.camera, X_VT, prior->second.X_WT));
  fuse_prior(x_, x_.tags.size() - 1, prior->second);
}

/// By a tag of the state that the map has by now or, when allowed, by the reference tag.
void RcarsFilter::define_workspace(const MapKnowledge& map) {
  for (const KnownTag& known : map.tags) {
    const auto own = x_.find(known.tag_id);
    if (is_anchored_ || !own) continue;
    moved_workspace(define_by_known(x_, 0, Pose(x_.tags[*own].X_VT), known.X_WT));
    fuse_prior(x_, *own, known);
  }
  if (!is_anchored_ && map.may_define_workspace && !x_.tags.empty()) {
    const auto own = gauge_.reference_tag ? x_.find(*gauge_.reference_tag) : std::size_t{0};
    if (!own) return;
    defined_by_ = x_.tags[*own].tag_id;
    heading_rule_ = make_heading_rule(gauge_, x_.X_WT(*own).X.q);
    moved_workspace(define_by_reference(x_, *own, heading_rule_));
  } else if (defined_by_) {
    define_by_reference(x_, *x_.find(*defined_by_), heading_rule_);  // slip of linearisation
  }
}

void RcarsFilter::moved_workspace(const Pose& X_new_old) {
  is_anchored_ = true;
  gauge_shift_ = X_new_old * gauge_shift_.value_or(Pose{});
}

void RcarsFilter::set_tag_priors(std::vector<KnownTag> priors) {
  priors_.clear();
  for (const KnownTag& prior : priors) priors_[prior.tag_id] = prior;
}

BodyEstimate RcarsFilter::estimate() const {
  FIDUCAP_ASSERT(running());
  BodyEstimate out = x_.body();
  out.anchored = is_anchored_;
  const InertialInput input = imu_.input_between(x_.time, x_.time);
  out.w_WB_B = input.w_B - x_.b_w;
  out.a_WB = x_.q * (input.f_B - x_.b_f) + g_W_;
  return out;
}

void RcarsFilter::tag_beliefs(std::vector<TagBelief>& out) const {
  out.clear();
  for (std::size_t i = 0; i < x_.tags.size(); ++i) {
    const Tag& tag = x_.tags[i];
    const LinearPose X_WT = x_.X_WT(i);
    out.push_back({{tag.tag_id, tag.edge_m, X_WT.X, x_.covariance_of(X_WT)},
                   tag.sightings,
                   tag.first_seen,
                   tag.last_seen,
                   is_anchored_ ? TagBelief::kWorkspace : TagBelief::kOwnAxes});
  }
}

std::vector<ExtrinsicsEstimate> RcarsFilter::extrinsics() const {
  std::vector<ExtrinsicsEstimate> out;
  for (int c = 0; c < static_cast<int>(x_.cameras.size()); ++c)
    out.push_back({.X_BV = x_.X_BV(c).X, .covariance = x_.covariance_of(x_.X_BV(c))});
  return out;
}

}  // namespace fiducap::rcars
