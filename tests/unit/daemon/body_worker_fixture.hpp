#pragma once

#include <gmock/gmock.h>

#include <cmath>

#include "daemon/bodies/body_worker.hpp"
#include "fake_body.hpp"
#include "support/fake_clock.hpp"

namespace fiducap {

constexpr Instant ms(int n) { return instant_from_ns(std::int64_t{n} * 1'000'000); }

/// At rest, with noise: equal readings would be reported.
inline ImuSample imu_at(Instant at) {
  const double noise = 1e-6 * std::sin(0.37 * static_cast<double>(to_ns(at) / 1'000'000));
  return {at, {noise, 0, 0}, {0, 0, 9.81}};
}

/// A tag of 100 px in the middle of the image.
inline TagSighting sighting(int id) {
  return {id, 0, 60.0, {{{326, 290}, {426, 290}, {426, 190}, {326, 190}}}};
}

inline CornerFrame frame_at(Instant at, std::vector<int> ids = {4}) {
  CornerFrame frame{0, at, {}};
  for (const int id : ids) frame.tags.push_back(sighting(id));
  return frame;
}

/// An image between two IMU readings.
inline std::vector<SensorSample> one_image() {
  return {imu_at(ms(1000)), imu_at(ms(1005)), frame_at(ms(1002))};
}

inline KnownTag known_tag(int id) {
  KnownTag tag{id, 0.16, {}};
  tag.covariance = Matrix6d::Identity() * 1e-6;
  return tag;
}

/// One body called `robot` with a camera and an IMU, everything real except its source and its
/// filter.
class BodyWorkerTest : public testing::Test {
 protected:
  BodyWorkerTest() {
    CameraMount mount;
    mount.model = {752, 480, 460, 460, 375.5, 239.5, Distortion::kNone, {}};
    sensors_.cameras = {mount};
    sensors_.imu = ImuNoise{};
  }

  void build(std::unique_ptr<SensorSource> source) {
    std::vector<BodySource> sources;
    sources.push_back({std::move(source)});
    build(std::move(sources));
  }
  void build(std::vector<BodySource> sources) {
    std::vector<SceneBody> bodies(1);
    bodies[0].description = {1, "robot"};
    bodies[0].sensors = sensors_;
    scene_ = std::make_unique<Scene>(bodies);
    map_ = std::make_unique<MapBuilder>(MapConfig{}, start_);
    PipelineSetup setup;
    setup.sensors = sensors_;
    setup.estimator = estimator_;
    worker_ = std::make_unique<BodyWorker>(
        BodyParts{0, 1, "robot", std::move(setup), std::move(sources), [this] { return filter(); }},
        SharedParts{*map_, *scene_, clock_, recorder_, events_});
  }
  std::unique_ptr<BodyFilter> filter() {
    auto filter = std::make_unique<RecordingFilter>(log_);
    filter_ = filter.get();
    if (fails_always_) filter_->throws_at = log_.updated.size() + 1;
    return filter;
  }
  void build(std::vector<SensorSample> samples) { build(giving(std::move(samples))); }

  /// Three images, a tenth of a second apart, with an IMU reading before each and one at the end.
  /// Each advances the clock by 50 ms.
  void build_three_images() {
    std::vector<SensorSample> samples;
    for (int i = 0; i < 3; ++i) {
      samples.push_back(imu_at(ms(1000 + 100 * i)));
      samples.push_back(frame_at(ms(1042 + 100 * i)));
    }
    samples.push_back(imu_at(ms(1300)));
    build(made([this, samples](int turn) -> MadeSource::Sample {
      clock_.advance(std::chrono::milliseconds(50));
      const auto at = static_cast<std::size_t>(turn);
      return at == samples.size() ? std::nullopt : std::optional(samples[at]);
    }));
  }

  /// Reader and worker at the same time.
  void run_together() {
    const std::jthread reader([this] { worker_->read(0, {}); });
    worker_->work({});
  }
  /// Reader and worker one after the other, without threads.
  void run() {
    worker_->read(0, {});
    worker_->work({});
  }
  /// Conditions of a silent IMU: "silent", then the text of their end.
  [[nodiscard]] std::vector<std::string> silences() const {
    std::vector<std::string> texts;
    for (const Event& event : events_.after(0))
      if (event.kind == "imu_silent") texts.push_back(event.over ? event.text : "silent");
    return texts;
  }
  void run(std::vector<SensorSample> samples) {
    build(std::move(samples));
    run();
  }
  BodyPose pose_at(Instant at) {
    return scene_->sample(at, at, {}, 100, map_->snapshot())->bodies.front();
  }

  EventBoard events_{[] { return std::int64_t{0}; }};
  BodySensors sensors_;
  TagMap start_;
  FakeClock clock_{ms(1000)};
  EstimatorConfig estimator_;
  SessionRecorder recorder_{RecorderConfig{}, clock_, events_};
  RecordingFilter::Log log_;
  RecordingFilter* filter_{nullptr};
  bool fails_always_{false};  ///< Every filter that is made from now on.
  std::unique_ptr<Scene> scene_;
  std::unique_ptr<MapBuilder> map_;
  std::unique_ptr<BodyWorker> worker_;
};

}  // namespace fiducap
