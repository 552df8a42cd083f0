#include "scene/scene.hpp"

#include "base/expected.hpp"

namespace fiducap {

template <typename Work>
void Scene::with_tracker(std::size_t body, Work&& work) {
  FIDUCAP_ASSERT(body < bodies_.size());
  const std::lock_guard lock(bodies_[body]->mutex);
  work(bodies_[body]->tracker);
}

Scene::Scene(const std::vector<SceneBody>& bodies) {
  for (const SceneBody& body : bodies) {
    list_.push_back({body.description, true, body.X_BP});
    bodies_.push_back(std::make_unique<Guarded>(BodyTracker(
        body.description.id, body.X_BP, body.limits, body.sensors, body.estimator, body.ramp)));
  }
  update_roster();
}

void Scene::update_roster() {
  auto model = std::make_shared<SceneModel>();
  if (roster_) model->generation = roster_->model->generation + 1;
  auto next = std::make_shared<Roster>();
  for (std::size_t i = 0; i < list_.size(); ++i) {
    if (!list_[i].enabled) continue;
    model->bodies.push_back(list_[i].description);
    next->bodies.push_back(i);
  }
  next->model = std::move(model);
  roster_ = std::move(next);
}

void Scene::set_enabled(std::size_t body, bool enabled) {
  FIDUCAP_ASSERT(body < bodies_.size());
  const std::lock_guard lock(list_mutex_);
  if (list_[body].enabled == enabled) return;
  list_[body].enabled = enabled;
  update_roster();
}

void Scene::rename(std::size_t body, const std::string& name) {
  FIDUCAP_ASSERT(body < bodies_.size());
  const std::lock_guard lock(list_mutex_);
  if (list_[body].description.name == name) return;
  list_[body].description.name = name;
  update_roster();
}

void Scene::set_pivot(std::size_t body, const Pose& X_BP) {
  {
    const std::lock_guard lock(list_mutex_);
    FIDUCAP_ASSERT(body < list_.size());
    list_[body].X_BP = X_BP;
  }
  with_tracker(body, [&](BodyTracker& tracker) { tracker.set_pivot(X_BP); });
}

void Scene::add_imu(std::size_t body, const ImuSample& imu) {
  with_tracker(body, [&](BodyTracker& tracker) { tracker.add_imu(imu); });
}

void Scene::ingest(std::size_t body, const std::optional<BodyEstimate>& estimate,
                   const UpdateReport& report, Duration processing, std::uint64_t images_dropped) {
  if (estimate && estimate->anchored) tag_fits_.add(report);
  with_tracker(body, [&](BodyTracker& tracker) {
    tracker.ingest(estimate, report, processing, images_dropped);
  });
}

void Scene::source_lost(std::size_t body) {
  with_tracker(body, [](BodyTracker& tracker) { tracker.source_lost(); });
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
  const auto listed = roster();
  frame->model = listed->model;
  frame->map = room_.set_map(std::move(map));
  frame->axes = room_.number();
  frame->bodies.resize(listed->bodies.size());
  for (std::size_t i = 0; i < listed->bodies.size(); ++i) {
    with_tracker(listed->bodies[i],
                 [&](BodyTracker& tracker) { tracker.sample(at, frame->bodies[i]); });
    room_.transform(frame->bodies[i]);
  }
  return frame;
}

}  // namespace fiducap
