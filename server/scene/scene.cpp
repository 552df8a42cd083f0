#include "scene/scene.hpp"

#include "base/assert.hpp"

namespace fiducap {

Scene::Scene(const std::vector<SceneBody>& bodies) {
  auto model = std::make_shared<SceneModel>();
  for (const SceneBody& body : bodies) {
    model->bodies.push_back(body.description);
    bodies_.push_back(std::make_unique<Guarded>(
        BodyTracker(body.description.id, body.X_BP, body.limits, body.sensors, body.estimator)));
  }
  model_ = std::move(model);
}

Scene::Guarded& Scene::guarded(std::size_t body) const {
  FIDUCAP_ASSERT(body < bodies_.size());
  return *bodies_[body];
}

void Scene::add_imu(std::size_t body, const ImuSample& imu) {
  Guarded& one = guarded(body);
  const std::lock_guard lock(one.mutex);
  one.tracker.add_imu(imu);
}

void Scene::ingest(std::size_t body, const std::optional<BodyEstimate>& estimate,
                   const UpdateReport& report, Duration processing, std::uint64_t images_dropped) {
  Guarded& one = guarded(body);
  const std::lock_guard lock(one.mutex);
  one.tracker.ingest(estimate, report, processing, images_dropped);
}

void Scene::source_lost(std::size_t body) {
  Guarded& one = guarded(body);
  const std::lock_guard lock(one.mutex);
  one.tracker.source_lost();
}

bool Scene::wants_reset(std::size_t body, Instant now) const {
  Guarded& one = guarded(body);
  const std::lock_guard lock(one.mutex);
  return one.tracker.wants_reset(now);
}

std::shared_ptr<const SceneFrame> Scene::sample(Instant at, Instant published_at,
                                                Duration utc_offset, double rate_hz,
                                                std::shared_ptr<const TagMap> map) {
  auto frame = frames_.acquire();
  frame->number = next_number_++;
  frame->at = at;
  frame->published_at = published_at;
  frame->utc_offset = utc_offset;
  frame->rate_hz = rate_hz;
  frame->model = model_;
  frame->map = std::move(map);
  frame->bodies.resize(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const std::lock_guard lock(bodies_[i]->mutex);
    bodies_[i]->tracker.sample(at, frame->bodies[i]);
  }
  return frame;
}

}  // namespace fiducap
