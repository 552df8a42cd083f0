#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "capture/sensor_source.hpp"
#include "support/idle_filter.hpp"

namespace fiducap {

/// Gives what is made for each turn.
class MadeSource final : public SensorSource {
 public:
  using Sample = Expected<std::optional<SensorSample>>;
  explicit MadeSource(std::function<Sample(int turn)> make) : make_(std::move(make)) {}
  Sample next(std::stop_token stop) override {
    return stop.stop_requested() ? Sample() : make_(turn_++);
  }

 private:
  std::function<Sample(int turn)> make_;
  int turn_{0};
};

inline std::unique_ptr<SensorSource> made(std::function<MadeSource::Sample(int turn)> make) {
  return std::make_unique<MadeSource>(std::move(make));
}

/// Throws a number of times, gives the samples, then ends or fails.
inline std::unique_ptr<SensorSource> giving(std::vector<SensorSample> samples, int throws = 0,
                                            std::optional<Error> error = {}) {
  return made([samples = std::move(samples), throws, error](int turn) -> MadeSource::Sample {
    if (turn < throws) throw std::runtime_error("the driver threw");
    const auto at = static_cast<std::size_t>(turn - throws);
    if (at < samples.size()) return samples[at];
    if (error) return tl::unexpected(*error);
    return std::nullopt;
  });
}

constexpr int kAhead = 3;
/// Gives the samples, but never runs more than `kAhead` images ahead of the filter, so that none is
/// dropped.
inline std::unique_ptr<SensorSource> paced(std::vector<SensorSample> samples,
                                           const std::atomic<int>& images_done) {
  return made([samples = std::move(samples), &images_done,
               given = 0](int turn) mutable -> MadeSource::Sample {
    const auto at = static_cast<std::size_t>(turn);
    if (at == samples.size()) return std::nullopt;
    if (std::holds_alternative<CornerFrame>(samples[at])) {
      while (given - images_done >= kAhead) std::this_thread::yield();
      ++given;
    }
    return std::move(samples[at]);
  });
}

/// Records its input; its estimate is a body at rest in the workspace.
class RecordingFilter final : public IdleFilter<> {
 public:
  struct Log {
    std::vector<Instant> propagated;
    std::vector<TagObservations> updated;
    std::vector<std::vector<KnownTag>> known;
  };
  explicit RecordingFilter(Log& log) : log_(log) {}

  void propagate(const ImuSample& imu) override {
    if (!quiet) log_.propagated.push_back(imu.sampled_at);
  }
  UpdateReport update(const TagObservations& seen, const MapKnowledge& map) override {
    ++images_done;
    if (on_image) on_image(images_done);
    if (!quiet) log_.updated.push_back(seen);
    if (!quiet) log_.known.emplace_back(map.tags.begin(), map.tags.end());
    if (throws_at > 0 && log_.updated.size() == throws_at)
      throw std::runtime_error("a matrix is singular");
    UpdateReport report;
    report.exposed_at = estimate_.at = seen.exposed_at;
    report.tags_seen = report.tags_used = static_cast<int>(seen.tags.size());
    report.running = true;
    return report;
  }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate = estimate_;
    estimate.anchored = true;
    estimate.covariance = Matrix15d::Identity() * 1e-4;
    return estimate;
  }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out = beliefs; }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override {
    if (quiet) return {};
    return {{Pose{}, Matrix6d::Identity()}};
  }

  std::vector<TagBelief> beliefs;
  std::size_t throws_at{0};
  bool quiet{false};  ///< Records nothing, so that it allocates nothing.
  std::atomic<int> images_done{0};
  std::function<void(int images_done)> on_image;

 private:
  Log& log_;
  BodyEstimate estimate_;
};

}  // namespace fiducap
