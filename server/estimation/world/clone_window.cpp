#include "estimation/world/clone_window.hpp"

#include <algorithm>
#include <span>

#include "estimation/filter/linear_term.hpp"
#include "estimation/world/camera_moment.hpp"

namespace fiducap::world {

namespace {

constexpr int kFewestViews = 4;  // five numbers of eight are left: enough to notice a wrong one

const PointObservation* find(const TagObservations& image, std::uint32_t track) {
  const auto found =
      std::lower_bound(image.points.begin(), image.points.end(), track,
                       [](const PointObservation& p, std::uint32_t t) { return p.track < t; });
  return found == image.points.end() || found->track != track ? nullptr : &*found;
}

}  // namespace

CloneWindow::CloneWindow(std::size_t cameras, const LandmarkRules& rules)
    : longest_(kClones / static_cast<int>(cameras)), update_(kClones, rules) {}

void CloneWindow::clone(FilterState& state, int camera, long image) {
  const auto oldest =
      std::min_element(state.clones.begin(), state.clones.end(),
                       [](const Clone& a, const Clone& b) { return a.image < b.image; });
  const CameraAt at_exposure =
      camera_at(state, camera, state.clocks[static_cast<std::size_t>(camera)].seconds_to(0));
  *oldest = {at_exposure.X_WV, camera, image};
  const int at = state.clone_at(static_cast<std::size_t>(oldest - state.clones.begin()));
  // The error of a camera is that of X_WV already: but for its clock, the clone's error is the same
  // number.
  const SharedPose error = error_of(at_exposure, camera);
  redefine(state.covariance, at, at + 3, std::span(error.terms).first(error.term_count),
           Matrix6d::Zero());
}

LandmarkReport CloneWindow::correct(FilterState& state, ImageMemory& memory,
                                    const CameraModel& model, int camera) {
  if (longest_ < kFewestViews) return {};
  list_images(state, memory, camera);
  if (images_.size() < static_cast<std::size_t>(kFewestViews)) return {};
  list_due();
  update_.begin();
  for (const Due& due : due_) {
    if (update_.is_full()) break;
    gather(state, due.track, due.first_age, due.last_age);
    if (static_cast<int>(views_.size()) >= kFewestViews) update_.add(state, model, views_);
  }
  return update_.apply(state);
}

void CloneWindow::list_images(const FilterState& state, ImageMemory& memory, int camera) {
  images_.clear();
  for (std::size_t k = 0; k < state.clones.size(); ++k) {
    const Clone& clone = state.clones[k];
    if (clone.image < 0 || clone.camera != camera || !memory.has(clone.image)) continue;
    images_.push_back({static_cast<int>(k), &memory.image(clone.image).seen});
  }
  std::sort(images_.begin(), images_.end(),
            [](const Seen& a, const Seen& b) { return a.image->exposed_at < b.image->exposed_at; });
}

void CloneWindow::list_due() {
  due_.clear();
  const TagObservations& now = *images_.back().image;
  const TagObservations& before = *images_[images_.size() - 2].image;
  for (const PointObservation& point : now.points) {
    if (point.age % longest_ == longest_ - 1)
      due_.push_back({point.track, point.age - longest_ + 1, point.age});
  }
  for (const PointObservation& point : before.points) {
    const int length = point.age % longest_ + 1;
    if (length < longest_ && length >= kFewestViews && find(now, point.track) == nullptr) {
      due_.push_back({point.track, point.age - length + 1, point.age});
    }
  }
  // Long ones first: where not all can be used, they say most.
  std::stable_sort(due_.begin(), due_.end(), [](const Due& a, const Due& b) {
    return a.last_age - a.first_age > b.last_age - b.first_age;
  });
}

void CloneWindow::gather(const FilterState& state, std::uint32_t track, int first_age,
                         int last_age) {
  views_.clear();
  for (const Seen& seen : images_) {
    const PointObservation* point = find(*seen.image, track);
    if (point == nullptr || point->age < first_age || point->age > last_age) continue;
    views_.push_back({seen.slot, state.clones[static_cast<std::size_t>(seen.slot)].X_WV, point->px,
                      point->ideal_from_raw});
  }
}

}  // namespace fiducap::world
