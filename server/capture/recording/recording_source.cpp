#include <cmath>

#include "base/log.hpp"
#include "capture/recording/recording.hpp"
#include "capture/recording/recording_streams.hpp"

namespace fiducap {
namespace {

void shift(SensorSample& sample, Instant to) {
  struct Stamp {
    Instant at;
    void operator()(ImuSample& s) const { s.sampled_at = at; }
    void operator()(CameraFrame& s) const { s.exposed_at = at; }
    void operator()(CornerFrame& s) const { s.exposed_at = at; }
  };
  std::visit(Stamp{to}, sample);
}

/// The streams of a recording merged by time, once or again and again.
class RecordingSource final : public SensorSource {
 public:
  RecordingSource(RecordingInfo info, const RecordingPlayback& playback, const Clock& clock)
      : info_(std::move(info)), playback_(playback), clock_(clock) {}

  Expected<void> rewind();
  Expected<std::optional<SensorSample>> next(std::stop_token stop) override;

 private:
  struct Lane {
    SampleStream stream;
    std::optional<SensorSample> head;
  };

  void advance(Lane& lane) {
    lane.head = std::visit([](auto& stream) { return stream.next(); }, lane.stream);
  }
  Lane* earliest();
  Expected<bool> start_again();
  void end_of_pass();
  Instant moved(Instant recorded);

  RecordingInfo info_;
  RecordingPlayback playback_;
  const Clock& clock_;
  GrayImagePool pool_;
  std::vector<Lane> lanes_;
  bool first_pass_{true};
  bool pass_ended_{false};
  Duration pass_offset_{0};             ///< Added to every stamp of this pass.
  std::optional<Instant> first_;        ///< Of this pass, as recorded.
  std::optional<Instant> last_;         ///< Newest of this pass, as recorded.
  std::optional<Instant> played_from_;  ///< First stamp of the first pass, as recorded …
  Instant played_at_{};                 ///< … and when it was given out.
};

Expected<void> RecordingSource::rewind() {
  Expected<std::vector<SampleStream>> streams = open_streams(info_, pool_);
  if (!streams) return tl::unexpected(streams.error());
  lanes_.clear();
  for (SampleStream& stream : *streams) {
    lanes_.push_back({std::move(stream), std::nullopt});
    advance(lanes_.back());
  }
  first_.reset();
  last_.reset();
  pass_ended_ = false;
  return {};
}

RecordingSource::Lane* RecordingSource::earliest() {
  Lane* found = nullptr;
  for (Lane& lane : lanes_) {
    if (lane.head && (found == nullptr || time_of(*lane.head) < time_of(*found->head)))
      found = &lane;
  }
  return found;
}

void RecordingSource::end_of_pass() {
  if (std::exchange(pass_ended_, true) || !first_pass_) return;
  for (const Lane& lane : lanes_) {
    std::visit([](const auto& stream) { stream.log_damage(); }, lane.stream);
  }
}

// @return false when playing is over.
Expected<bool> RecordingSource::start_again() {
  end_of_pass();
  if (!playback_.loop || !first_) return false;  // without any sample it would spin for ever
  const double rate_hz = info_.cameras.empty() ? 20.0 : info_.cameras.front().rate_hz;
  const Duration gap = from_seconds(1.0 / (rate_hz > 1e-3 ? rate_hz : 20.0));
  pass_offset_ += *last_ - *first_ + gap;
  first_pass_ = false;
  if (const auto opened = rewind(); !opened) return tl::unexpected(opened.error());
  return true;
}

Instant RecordingSource::moved(Instant recorded) {
  const Instant of_all_passes = recorded + pass_offset_;
  if (!playback_.paced) return of_all_passes;
  if (!played_from_) {
    played_from_ = of_all_passes;
    played_at_ = clock_.now();
  }
  const Duration since_start = of_all_passes - *played_from_;
  if (playback_.speed == 1.0) return played_at_ + since_start;
  return played_at_ + from_seconds(to_seconds(since_start) / playback_.speed);
}

Expected<std::optional<SensorSample>> RecordingSource::next(std::stop_token stop) {
  if (stop.stop_requested()) return std::nullopt;
  Lane* lane = earliest();
  if (lane == nullptr) {
    const Expected<bool> again = start_again();
    if (!again) return tl::unexpected(again.error());
    lane = *again ? earliest() : nullptr;
    if (lane == nullptr) return std::nullopt;
  }
  const Instant recorded = time_of(*lane->head);
  if (!first_ || recorded < *first_) first_ = recorded;
  if (!last_ || recorded > *last_) last_ = recorded;
  const Instant at = moved(recorded);
  if (playback_.paced && !clock_.wait_until(at, stop)) return std::nullopt;
  SensorSample sample = std::move(*lane->head);
  advance(*lane);
  shift(sample, at);
  return sample;
}

}  // namespace

Expected<std::unique_ptr<SensorSource>> open_recording(const RecordingInfo& info,
                                                       const RecordingPlayback& playback,
                                                       const Clock& clock) {
  if (playback.paced && !(playback.speed >= 0.01 && playback.speed <= 100)) {
    return fail(ErrorCode::kInvalid, "speed must be in [0.01, 100]", info.folder);
  }
  if (playback.paced && playback.speed != 1.0 && info.imu) {
    return fail(ErrorCode::kUnsupported,
                "speed must be 1 for a recording with IMU: what it measured would not fit the "
                "stretched time",
                info.folder);
  }
  auto source = std::make_unique<RecordingSource>(info, playback, clock);
  if (const auto opened = source->rewind(); !opened) return tl::unexpected(opened.error());
  return source;
}

std::vector<ConfigError> check_source(const RecordingSourceConfig& config,
                                      const SourceSurroundings& around,
                                      const std::string& body_prefix) {
  return Checker{body_prefix}
      .require(!config.folder.empty(), "source.folder", "\"\"", "must name a recording")
      .positive("source.speed", config.speed)
      .require(!around.has_imu_source, "imu_source", "{…}",
               "cannot be: a recording has its IMU in it")
      .errors;
}

}  // namespace fiducap
