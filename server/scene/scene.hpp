#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/object_pool.hpp"
#include "scene/body_tracker.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

struct SceneBody {
  BodyDescription description;
  Pose X_BP;
  BodyLimits limits;
  BodySensors sensors;
  EstimatorConfig estimator;
};

/// All bodies. The one object that several threads enter: one mutex per body inside, held for the
/// few microseconds of that body's prediction and never two at a time; immutable frames out.
class Scene final {
 public:
  explicit Scene(const std::vector<SceneBody>& bodies);

  /// @param body  index in the constructor's list; what the calls mean is said in BodyTracker
  void add_imu(std::size_t body, const ImuSample& imu);
  void ingest(std::size_t body, const std::optional<BodyEstimate>& estimate,
              const UpdateReport& report, Duration processing, std::uint64_t images_dropped);
  void source_lost(std::size_t body);
  [[nodiscard]] bool wants_reset(std::size_t body, Instant now) const;

  /// Every body brought to `at`. One caller (the publisher). Allocates nothing after warm-up.
  [[nodiscard]] std::shared_ptr<const SceneFrame> sample(Instant at, Instant published_at,
                                                         Duration utc_offset, double rate_hz,
                                                         std::shared_ptr<const TagMap> map);
  [[nodiscard]] std::shared_ptr<const SceneModel> model() const { return model_; }

 private:
  struct Guarded {
    std::mutex mutex;
    BodyTracker tracker;
    explicit Guarded(BodyTracker t) : tracker(std::move(t)) {}
  };
  [[nodiscard]] Guarded& guarded(std::size_t body) const;

  std::shared_ptr<const SceneModel> model_;
  std::vector<std::unique_ptr<Guarded>> bodies_;
  ObjectPool<SceneFrame> frames_;
  std::uint64_t next_number_{1};
};

}  // namespace fiducap
