#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/object_pool.hpp"
#include "pipeline/body_tracker.hpp"
#include "scene/room_axes.hpp"
#include "scene/scene_frame.hpp"
#include "scene/tag_fits.hpp"

namespace fiducap {

struct SceneBody {
  BodyDescription description;
  Pose X_BP;
  BodyLimits limits;
  BodySensors sensors;
  EstimatorConfig estimator;
  RampConfig ramp;
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
  /// How well the sightings of tags fit. From any thread.
  [[nodiscard]] const TagFits& tag_fits() const { return tag_fits_; }

  /// Every body brought to `at`, bodies and map in the room's axes (RoomAxes). One caller (the
  /// publisher). Allocates nothing after warm-up, but for a new map that is aligned to the room.
  [[nodiscard]] std::shared_ptr<const SceneFrame> sample(Instant at, Instant published_at,
                                                         Duration utc_offset, double rate_hz,
                                                         std::shared_ptr<const TagMap> map);
  /// The enabled bodies. From any thread.
  [[nodiscard]] std::shared_ptr<const SceneModel> model() const;

  /// A disabled body is followed on, but no client sees it. From any thread, like the two below;
  /// each change of the list makes a new generation of the model.
  void set_enabled(std::size_t body, bool enabled);
  void rename(std::size_t body, const std::string& name);
  void set_pivot(std::size_t body, const Pose& X_BP);
  struct Listed {
    BodyDescription description;
    bool enabled{true};
    Pose X_BP;
  };
  /// All bodies, in the constructor's order.
  [[nodiscard]] std::vector<Listed> list() const;

 private:
  struct Guarded {
    std::mutex mutex;
    BodyTracker tracker;
    explicit Guarded(BodyTracker t) : tracker(std::move(t)) {}
  };
  /// Which bodies a frame holds, immutable.
  struct Roster {
    std::shared_ptr<const SceneModel> model;
    std::vector<std::size_t> bodies;  ///< Index in bodies_, order of model->bodies.
  };
  [[nodiscard]] Guarded& guarded(std::size_t body) const;
  [[nodiscard]] std::shared_ptr<const Roster> roster() const;
  void renew_roster();

  std::vector<std::unique_ptr<Guarded>> bodies_;
  TagFits tag_fits_;
  mutable std::mutex
      list_mutex_;  ///< For the two below; held to read or change them, never while computing.
  std::vector<Listed> list_;
  std::shared_ptr<const Roster> roster_;
  RoomAxes room_;  ///< Of the publisher.
  ObjectPool<SceneFrame> frames_;
  std::uint64_t next_number_{1};
};

}  // namespace fiducap
