#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/filter/corner_noise.hpp"
#include "estimation/filter/stacked_update.hpp"

namespace fiducap {

/// The update of RCARS II-D4 with all tags of one image at once, iterated if asked for. Keeps its
/// memory between images.
///
/// @tparam State  a filter's mean and covariance: `P()`, `add_error`, `error_to`, `copy_mean`,
/// `held_tags()`, and next to it
///                `void measure_image(const State&, int camera, const CameraModel&, std::span<const
///                TagToUse>, const CornerNoise&, ImageMeasurement&)` and `void
///                transport_covariance(State&, correction, int camera)`
template <class State>
class CornerUpdate final {
 public:
  struct Options {
    double gate{};  ///< Chi-square limit for the 8 numbers of one tag; a tag above it is left out.
    int iterations{
        1};  ///< 1: plain EKF. More: iterated, for a first image far from the linearisation point.
    /// Where the first linearisation is done, when something better than the prior mean is known;
    /// nullptr: at the prior.
    const State* start{nullptr};
    /// Whether shared_score() is asked for afterwards: it costs another division of the stack.
    bool wants_score{false};
  };

  /// @param noise     of this camera's corners; learns from every tag
  /// @param accepted  out: per entry of `tags`, whether it was used
  UpdateReport apply(State& state, int camera, const CameraModel& model,
                     std::span<const TagToUse> tags, const Options& options, CornerNoise& noise,
                     std::vector<bool>& accepted) {
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
    has_score_ = false;
    // What the accepted ones say of noises is too good when many are rejected.
    if (options.wants_score && 2 * report.tags_rejected >= static_cast<int>(tags.size()))
      score_all(state);
    if (update_.empty()) {
      if (moves) state.copy_mean(prior_);
      return report;
    }
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      if (iteration > 0) {
        // Iterated Kalman filter: the innovation is taken back to the prior, H stays at the present
        // point.
        measure_image(state, camera, model, tags, noise, image_);
        image_.take_off(state.error_to(prior_));
        update_.prepare(state.P(), image_);
      }
      const double nis = update_.solve(state.P(), image_, state.held_tags());
      if (iteration == 0) {
        report.nis = nis;
        if (options.wants_score && !has_score_) note_score();
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

  /// Of the last image, when it was asked for: what its tags said of the camera's pose; all of them
  /// when half of them or more were rejected.
  [[nodiscard]] bool has_score() const { return has_score_; }
  [[nodiscard]] const StackedUpdate::SharedScore& shared_score() const { return score_; }

 private:
  void score_all(const State& state) {
    gated_.assign(update_.used().begin(), update_.used().end());
    update_.use_all(image_);
    if (!update_.empty()) {
      (void)update_.solve(state.P(), image_, state.held_tags());
      note_score();
    }
    update_.use(gated_);
  }

  void note_score() {
    score_ = update_.shared_score(image_);
    has_score_ = true;
  }

  State prior_;  ///< mean only
  ImageMeasurement image_;
  StackedUpdate update_;
  std::vector<std::size_t> gated_;
  StackedUpdate::SharedScore score_;
  bool has_score_{false};
};

}  // namespace fiducap
