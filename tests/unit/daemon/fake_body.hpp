#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "capture/sensor_source.hpp"
#include "support/idle_filter.hpp"

namespace fiducap {

/// Throws a given number of times, gives its samples, then ends: with nullopt or an
/// error.
class ScriptedSource final : public SensorSource {
 public:
  explicit ScriptedSource(std::vector<SensorSample> samples)
      : samples_(samples.begin(), samples.end()) {}
  ScriptedSource(std::vector<SensorSample> samples, Error error)
      : ScriptedSource(std::move(samples)) {
    error_ = std::move(error);
  }

  Expected<std::optional<SensorSample>> next(std::stop_token stop) override {
    if (stop.stop_requested()) return std::nullopt;
    if (throws > 0) {
      --throws;
      throw std::runtime_error("the driver threw");
    }
    if (!samples_.empty()) {
      std::optional<SensorSample> sample(std::move(samples_.front()));
      samples_.pop_front();
      return sample;
    }
    if (error_) return tl::unexpected(*error_);
    return std::nullopt;
  }

  int throws{0};

 private:
  std::deque<SensorSample> samples_;
  std::optional<Error> error_;
};

/// Gives a made sample for each turn, until there is none.
class EndlessSource final : public SensorSource {
 public:
  using Make = std::function<std::optional<SensorSample>(int turn)>;
  explicit EndlessSource(Make make) : make_(std::move(make)) {}
  Expected<std::optional<SensorSample>> next(std::stop_token) override { return make_(turn_++); }

 private:
  Make make_;
  int turn_{0};
};

/// Gives prepared samples, but never runs more than a few images ahead of the filter, so that none
/// is dropped.
class PacedSource final : public SensorSource {
 public:
  static constexpr int kAhead = 3;

  PacedSource(std::vector<SensorSample> samples, const std::atomic<int>& images_done)
      : samples_(std::move(samples)), images_done_(images_done) {}

  Expected<std::optional<SensorSample>> next(std::stop_token) override {
    if (next_ == samples_.size()) return std::nullopt;
    if (std::holds_alternative<CornerFrame>(samples_[next_])) {
      while (images_given_ - images_done_ >= kAhead) std::this_thread::yield();
      ++images_given_;
    }
    return std::optional<SensorSample>(std::move(samples_[next_++]));
  }

 private:
  std::vector<SensorSample> samples_;
  const std::atomic<int>& images_done_;
  std::size_t next_{0};
  int images_given_{0};
};

/// Records its input; its estimate is a body at rest in the workspace.
class RecordingFilter final : public IdleFilter<> {
 public:
  struct Log {
    std::vector<Instant> propagated;
    std::vector<TagObservations> updated;
    std::vector<std::vector<KnownTag>> known;
    int losses{0};
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
  void lose_motion() override { ++log_.losses; }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate = estimate_;
    estimate.anchored = true;
    estimate.covariance = Matrix15d::Identity() * 1e-4;
    return estimate;
  }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out = beliefs; }
  void release_tag(int tag_id) override { released.push_back(tag_id); }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override {
    if (quiet) return {};
    return {{Pose{}, Matrix6d::Identity()}};
  }

  std::vector<TagBelief> beliefs;
  std::vector<int> released;
  std::size_t throws_at{0};
  bool quiet{false};  ///< Records nothing, so that it allocates nothing.
  std::atomic<int> images_done{0};
  std::function<void(int images_done)> on_image;

 private:
  Log& log_;
  BodyEstimate estimate_;
};

}  // namespace fiducap
