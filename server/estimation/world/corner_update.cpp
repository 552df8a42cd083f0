#include "estimation/world/image_update.hpp"

#include <cmath>

#include "estimation/world/corner_measurement.hpp"

namespace fiducap::world {

UpdateReport CornerUpdate::apply(FilterState& state, int camera, const CameraModel& model,
                                 std::span<const TagToUse> tags, const Options& options,
                                 CornerNoise& noise, std::vector<bool>& accepted) {
  UpdateReport report;
  const bool moves = options.iterations > 1 || options.start != nullptr;
  if (moves) prior_.copy_mean(state);
  if (options.start != nullptr) state.copy_mean(*options.start);
  measure_image(state, camera, model, tags, noise, image_);
  if (moves) image_.take_off(state.error_to(prior_));
  update_.prepare(state.P(), image_);
  update_.gate(state.P(), image_, options.gate, accepted);
  for (std::size_t i = 0; i < tags.size(); ++i)
    noise.learn(*tags[i].seen, update_.judged()[i].distance, update_.judged()[i].noise_share);
  report.tags_used = static_cast<int>(update_.used().size());
  report.tags_rejected = static_cast<int>(tags.size()) - report.tags_used;
  score_.reset();
  if (update_.empty()) {
    if (moves) state.copy_mean(prior_);
    return report;
  }
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    if (iteration > 0) {
      // Iterated Kalman filter: innovation relative to the prior, H at the present point.
      measure_image(state, camera, model, tags, noise, image_);
      update_.remove_outliers(image_);
      image_.take_off(state.error_to(prior_));
      update_.prepare(state.P(), image_);
    }
    const double nis = update_.solve(state.P(), image_, state.held_tags());
    if (iteration == 0) {
      report.nis = nis;
      if (options.wants_score) score_ = update_.shared_score(image_);
    }
    if (moves) state.copy_mean(prior_);
    state.add_error(update_.correction());
  }
  update_.shrink(state.P(), state.held_tags());
  transport_covariance(state, update_.correction(), camera);
  report.nis_dof = update_.degrees_of_freedom();
  measure_image(state, camera, model, tags, noise, image_);
  report.reprojection_px = update_.rms_px(image_);
  for (const TagMeasurement& tag : image_.tags)
    if (tag.in_front) report.name_fit({tag.tag_id, std::sqrt(tag.y.squaredNorm() / 4.0)});
  return report;
}

}  // namespace fiducap::world
