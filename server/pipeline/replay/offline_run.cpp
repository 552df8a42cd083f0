#include "pipeline/replay/offline_run.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "base/quantile.hpp"
#include "detection/observe.hpp"
#include "pipeline/guided_search.hpp"
#include "pipeline/replay/settled_trajectory.hpp"
#include "pipeline/replay/stage_clock.hpp"
#include "pipeline/tag_doubts.hpp"

namespace fiducap {
namespace {

constexpr double kFixedPosition_m = 1e-3;
constexpr double kFixedRotation_rad = 1e-3;
constexpr std::size_t kImuBatch = 4096;  // bounds the memory of a recording whose images never come

enum class Stage { kRead, kDetect, kPropagate, kUpdate, kSettle };

KnownTag known_tag(const RecordedTag& tag) {
  KnownTag known{tag.tag_id, tag.edge_m, tag.X_WT, Matrix6d::Zero()};
  known.covariance.diagonal().head<3>().setConstant(tag.position_sigma_m * tag.position_sigma_m);
  known.covariance.diagonal().tail<3>().setConstant(tag.rotation_sigma_rad *
                                                    tag.rotation_sigma_rad);
  return known;
}

class OfflineRun final {
 public:
  OfflineRun(const OfflineSetup& setup, SensorSource& source)
      : setup_(setup),
        source_(source),
        merger_({.has_imu = setup.sensors.imu.has_value()}),
        filter_(make_body_filter(setup.filter, setup.sensors, setup.gauge, setup.estimator)),
        settled_(setup.estimator.corner_noise_px),
        doubts_(setup.sensors, setup.estimator) {
    filter_->set_tag_priors(setup.priors);
    for (const KnownTag& tag : setup.known) known_.emplace(tag.tag_id, tag);
    for (const auto& [id, tag] : known_)
      map_.tags.push_back({tag, TagState::kSurveyed, 0, 0, 0, 0});
  }

  Expected<OfflineResult> run(const OfflineProgress& progress) {
    for (;;) {
      clock_.enter(Stage::kRead);
      const auto more = read_batch();
      if (!more) return tl::unexpected(more.error());
      clock_.enter(Stage::kPropagate);
      for (const ImuSample& imu : imu_batch_) {
        filter_->propagate(imu);
        doubts_.add(imu);
      }
      clock_.enter(Stage::kDetect);
      if (search_)
        for (const ImuSample& imu : imu_batch_) search_->add_imu(imu);
      if (image_) take_image();
      if (!*more) break;
      if (progress) progress(data_seconds());
    }
    clock_.leave();
    return finish();
  }

 private:
  /// Fills imu_batch_ up to the next image and image_ with it. @return false when nothing more will
  /// come.
  Expected<bool> read_batch() {
    imu_batch_.clear();
    image_.reset();
    while (imu_batch_.size() < kImuBatch) {
      if (auto sample = merger_.pop()) {
        note_time(time_of(*sample));
        if (const auto* imu = std::get_if<ImuSample>(&*sample)) {
          imu_batch_.push_back(*imu);
          ++result_.statistics.imu_samples;
          continue;
        }
        image_ = std::move(sample);
        return true;
      }
      if (exhausted_) return false;
      auto next = source_.next({});
      if (!next) return tl::unexpected(next.error());
      exhausted_ = !next->has_value();
      if (exhausted_) {
        merger_.finish();
      } else if (!merger_.push(std::move(**next))) {
        return fail(
            ErrorCode::kInvalid,
            "too many IMU samples wait for an image; are the stamps of the sensors on one clock?");
      }
    }
    return true;
  }

  void note_time(Instant at) {
    if (!first_) first_ = at;
    last_ = std::max(last_.value_or(at), at);
  }
  [[nodiscard]] double data_seconds() const { return first_ ? to_seconds(*last_ - *first_) : 0.0; }

  void take_image() {
    if (const auto* image = std::get_if<CameraFrame>(&*image_)) {
      clock_.enter(Stage::kDetect);
      detect(*image);
    } else {
      corners_ = std::move(std::get<CornerFrame>(*image_));
    }
    clock_.enter(Stage::kUpdate);
    const CameraMount& camera =
        setup_.sensors.cameras.at(static_cast<std::size_t>(corners_.camera));
    observe(corners_, camera.model, setup_.tags, setup_.detector, seen_);
    visible_known_.clear();
    for (const TagObservation& tag : seen_.tags)
      if (const auto found = known_.find(tag.tag_id); found != known_.end())
        visible_known_.push_back(found->second);
    const UpdateReport report = filter_->update(seen_, {visible_known_});
    count(report);
    doubt(report);
    merger_.set_clock_shift(seen_.camera,
                            shift_to_apply(filter_->clock(seen_.camera), seen_.clock_shift));
    if (search_) guide();
    if (!setup_.sensors.imu) remember_for_settling();
  }

  void detect(const CameraFrame& image) {
    if (!search_) search_.emplace(setup_.sensors, setup_.tags, setup_.detector, setup_.estimator);
    corners_ = search_->search(image, beliefs_, map_);
  }

  void doubt(const UpdateReport& report) {
    filter_->tag_beliefs(beliefs_);
    const auto estimate = filter_->running() ? std::optional(filter_->estimate()) : std::nullopt;
    (void)doubts_.add(seen_, report, estimate, beliefs_, visible_known_);
  }

  /// Tells the search what the filter made of the image.
  void guide() {
    search_->corrected(*filter_,
                       filter_->running() ? std::optional(filter_->estimate()) : std::nullopt);
    filter_->tag_beliefs(beliefs_);
  }

  void remember_for_settling() {
    const bool placed = filter_->running() && filter_->estimate().at == seen_.exposed_at &&
                        filter_->estimate().anchored;
    filter_->tag_beliefs(beliefs_);
    std::vector<KnownTag> tags = visible_known_;
    for (const TagBelief& belief : beliefs_) tags.push_back(belief.tag);
    settled_.add(seen_, placed ? std::optional(filter_->estimate().X_WB) : std::nullopt, tags);
  }

  void count(const UpdateReport& report) {
    OfflineStatistics& s = result_.statistics;
    const bool with_tags = !seen_.tags.empty();
    ++s.frames;
    s.frames_with_tags += with_tags ? 1 : 0;
    s.tags_rejected += report.tags_rejected;
    s.tags_used += report.tags_used;
    s.nis_sum += report.nis;
    s.nis_dof += report.nis_dof;
    if (report.tags_used > 0) reprojections_px_.push_back(report.reprojection_px);
    if (report.gauge_shift) shift_gauge(*report.gauge_shift);
    if (!filter_->running()) return;
    const BodyEstimate estimate = filter_->estimate();
    // Without IMU an image without a usable tag does not move the state.
    if (estimate.at != seen_.exposed_at || !estimate.X_WB.p.allFinite()) return;
    ++unplaced_.frames;
    unplaced_.frames_with_tags += with_tags ? 1 : 0;
    add_pose({seen_.exposed_at, estimate.X_WB});
    if (estimate.anchored) place();
  }

  /// Cameras that expose together share one line; the last of them has corrected the pose.
  void add_pose(const StampedPose& pose) {
    std::vector<StampedPose>& poses = result_.trajectory;
    if (!poses.empty() && poses.back().at == pose.at)
      poses.back() = pose;
    else
      poses.push_back(pose);
  }

  /// W was re-defined: the poses so far move with it. They stay causal, only their common axes come
  /// later.
  void shift_gauge(const Pose& X_new_old) {
    for (StampedPose& pose : result_.trajectory) pose.X_WB = X_new_old * pose.X_WB;
  }

  /// From here on W is the workspace: all poses up to here count.
  void place() {
    result_.statistics.frames_with_pose += unplaced_.frames;
    result_.statistics.frames_with_tags_and_pose += unplaced_.frames_with_tags;
    unplaced_ = {};
    placed_poses_ = result_.trajectory.size();
  }

  Expected<OfflineResult> finish() {
    OfflineStatistics& s = result_.statistics;
    s.data_s = data_seconds();
    s.read_cpu_s = clock_.seconds(Stage::kRead);
    s.detect_cpu_s = clock_.seconds(Stage::kDetect);
    s.propagate_cpu_s = clock_.seconds(Stage::kPropagate);
    s.update_cpu_s = clock_.seconds(Stage::kUpdate);
    s.reprojection_median_px = quantile(reprojections_px_, 0.5);
    s.reprojection_p95_px = quantile(std::move(reprojections_px_), 0.95);
    s.merger = merger_.statistics();
    result_.trajectory.resize(placed_poses_);  // the rest never learned where the workspace is
    result_.known = setup_.known;
    filter_->tag_beliefs(result_.tags);
    result_.doubts = doubts_.said();
    result_.extrinsics = filter_->extrinsics();
    if (!setup_.sensors.imu)
      if (auto settled = settle(); !settled) return tl::unexpected(settled.error());
    return std::move(result_);
  }

  /// Without IMU map and trajectory are refined together; what was known live is kept beside them.
  Expected<void> settle() {
    clock_.enter(Stage::kSettle);
    SettlingStart start{
        setup_.sensors.cameras, result_.known, {}, setup_.priors, setup_.gauge.reference_tag};
    for (std::size_t k = 0; k < result_.extrinsics.size(); ++k)
      start.cameras[k].X_BV = result_.extrinsics[k].X_BV;
    std::erase_if(result_.tags,
                  [&](const TagBelief& belief) { return known_.contains(belief.tag.tag_id); });
    for (const TagBelief& belief : result_.tags) start.estimated.push_back(belief.tag);
    auto settled = settled_.settle(start);
    if (!settled) return tl::unexpected(settled.error());
    for (std::size_t i = 0; i < result_.tags.size(); ++i) result_.tags[i].tag = settled->tags[i];
    result_.live = std::move(result_.trajectory);
    result_.trajectory = std::move(settled->trajectory);
    result_.statistics.frames_with_pose = settled->images;
    result_.statistics.frames_with_tags_and_pose = result_.statistics.frames_with_pose;
    clock_.leave();
    result_.statistics.settle_cpu_s = clock_.seconds(Stage::kSettle);
    return {};
  }

  const OfflineSetup& setup_;
  SensorSource& source_;
  SampleMerger merger_;
  std::unique_ptr<BodyFilter> filter_;
  SettledTrajectory settled_;
  TagDoubts doubts_;
  std::vector<TagBelief> beliefs_;
  std::optional<GuidedSearch> search_;
  std::map<int, KnownTag> known_;
  TagMap map_;  ///< The same, for the search.
  StageClock<Stage, 5> clock_;
  std::vector<ImuSample> imu_batch_;
  std::optional<SensorSample> image_;
  CornerFrame corners_;
  TagObservations seen_;
  std::vector<KnownTag> visible_known_;
  std::vector<double> reprojections_px_;
  std::optional<Instant> first_;
  std::optional<Instant> last_;
  bool exhausted_{false};
  struct Unplaced {
    int frames{};
    int frames_with_tags{};
  } unplaced_;
  std::size_t placed_poses_{0};
  OfflineResult result_;
};

}  // namespace

OfflineSetup offline_setup(const RecordingInfo& info) {
  OfflineSetup setup;
  setup.sensors.cameras = info.cameras;
  setup.sensors.imu = info.imu;
  setup.tags = {info.tag_family, info.tag_size_m, info.tag_sizes_m, info.ignore_tags};
  if (info.max_hamming) setup.tags.max_hamming = *info.max_hamming;
  setup.gauge.reference_tag = info.reference_tag;
  for (const RecordedTag& tag : info.known_tags) {
    const bool fixed =
        tag.position_sigma_m < kFixedPosition_m && tag.rotation_sigma_rad < kFixedRotation_rad;
    (fixed ? setup.known : setup.priors).push_back(known_tag(tag));
    if (tag.tag_id == info.reference_tag) setup.gauge.X_WT = tag.X_WT;
  }
  return setup;
}

Expected<OfflineResult> run_offline(const OfflineSetup& setup, SensorSource& source,
                                    const OfflineProgress& progress) {
  return OfflineRun(setup, source).run(progress);
}

}  // namespace fiducap
