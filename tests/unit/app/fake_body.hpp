#pragma once

#include <deque>
#include <functional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "capture/sensor_source.hpp"
#include "estimation/body_filter.hpp"

namespace fiducap {

/// Gives the samples it was given, then ends: with nullopt, an error or an exception.
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
    if (!samples_.empty()) {
      std::optional<SensorSample> sample(std::move(samples_.front()));
      samples_.pop_front();
      return sample;
    }
    if (throws) throw std::runtime_error("the driver threw");
    if (error_) return tl::unexpected(*error_);
    return std::nullopt;
  }

  bool throws{false};

 private:
  std::deque<SensorSample> samples_;
  std::optional<Error> error_;
};

/// Writes down what it is asked, and answers with a body at rest in the workspace.
class RecordingFilter final : public BodyFilter {
 public:
  struct Log {
    std::vector<Instant> propagated;
    std::vector<TagObservations> updated;
    std::vector<std::vector<KnownTag>> known;
    int losses{0};
  };
  explicit RecordingFilter(Log& log) : log_(log) {}

  void propagate(const ImuSample& imu) override { log_.propagated.push_back(imu.sampled_at); }
  UpdateReport update(const TagObservations& seen, std::span<const KnownTag> known) override {
    log_.updated.push_back(seen);
    log_.known.emplace_back(known.begin(), known.end());
    if (throws_at > 0 && log_.updated.size() == throws_at)
      throw std::runtime_error("a matrix is singular");
    UpdateReport report;
    report.exposed_at = estimate_.at = seen.exposed_at;
    report.tags_seen = report.tags_used = static_cast<int>(seen.tags.size());
    report.running = true;
    return report;
  }
  void set_tag_priors(std::vector<KnownTag>) override {}
  void lose_motion() override { ++log_.losses; }
  [[nodiscard]] bool running() const override { return true; }
  [[nodiscard]] BodyEstimate estimate() const override {
    BodyEstimate estimate = estimate_;
    estimate.anchored = true;
    estimate.covariance = Matrix15d::Identity() * 1e-4;
    return estimate;
  }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out = beliefs; }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override {
    return {{Pose{}, Matrix6d::Identity()}};
  }

  std::vector<TagBelief> beliefs;
  std::size_t throws_at{0};

 private:
  Log& log_;
  BodyEstimate estimate_;
};

}  // namespace fiducap
