#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/handover.hpp"
#include "pipeline/body_tracker.hpp"
#include "scene/scene_frame.hpp"

namespace fiducap {

struct SceneBody {
  BodyDescription description;
  Pose X_BP;
  BodyLimits limits;
  BodySensors sensors;
  EstimatorConfig estimator;
  RampConfig ramp;
};

/// All bodies, and the frames that are made of them. Thread-safe: each body has a mutex, which is
/// held for the few microseconds of its prediction, never two at a time. Frames are immutable.
class Scene final {
 public:
  explicit Scene(const std::vector<SceneBody>& bodies);

  /// See BodyTracker. @param body  index in the constructor's list
  void add_imu(std::size_t body, const ImuSample& imu);
  void ingest(std::size_t body, const std::optional<BodyEstimate>& estimate,
              const UpdateReport& report, Duration processing, std::uint64_t images_dropped);
  void source_lost(std::size_t body);
  /// How well the sightings of tags fit.
  [[nodiscard]] const TagFits& tag_fits() const { return tag_fits_; }

  /// Predicts the enabled bodies to `at`; bodies and map are in the room's axes (RoomAxes). For one
  /// thread, the publisher. Allocates nothing after warm-up, except for a new aligned map.
  [[nodiscard]] std::shared_ptr<const SceneFrame> sample(Instant at, Instant published_at,
                                                         Duration utc_offset, double rate_hz,
                                                         std::shared_ptr<const TagMap> map);
  /// The enabled bodies.
  [[nodiscard]] std::shared_ptr<const SceneModel> model() const { return roster()->model; }

  /// A disabled body is estimated but not in frames. Like `rename`, makes a new model generation.
  void set_enabled(std::size_t body, bool enabled);
  void rename(std::size_t body, const std::string& name);
  void set_pivot(std::size_t body, const Pose& X_BP);
  struct Listed {
    BodyDescription description;
    bool enabled{true};
    Pose X_BP;
  };
  /// All bodies, in the constructor's order.
  [[nodiscard]] std::vector<Listed> list() const {
    const std::lock_guard lock(list_mutex_);
    return list_;
  }

 private:
  struct Guarded {
    std::mutex mutex;
    BodyTracker tracker;
    explicit Guarded(BodyTracker t) : tracker(std::move(t)) {}
  };
  /// The bodies of a frame; immutable.
  struct Roster {
    std::shared_ptr<const SceneModel> model;
    std::vector<std::size_t> bodies;  ///< Index in bodies_, order of model->bodies.
  };
  template <typename Work>
  void with_tracker(std::size_t body, Work&& work);
  [[nodiscard]] std::shared_ptr<const Roster> roster() const {
    const std::lock_guard lock(list_mutex_);
    return roster_;
  }
  void update_roster();

  std::vector<std::unique_ptr<Guarded>> bodies_;
  TagFits tag_fits_;
  mutable std::mutex list_mutex_;  ///< Protects the next two; never held while computing.
  std::vector<Listed> list_;
  std::shared_ptr<const Roster> roster_;
  RoomAxes room_;  ///< Used by the publisher only.
  ObjectPool<SceneFrame> frames_;
  std::uint64_t next_number_{1};
};

}  // namespace fiducap
