#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "base/clock.hpp"
#include "daemon/views/body_views.hpp"
#include "daemon/views/camera_post.hpp"
#include "detection/candidate_search.hpp"
#include "streaming/camera_views.hpp"

namespace fiducap {

/// Pictures of all cameras: between the workers of the bodies and the pages. `run` is a thread of
/// its own and of low priority; it holds no lock that anybody else wants, and does nothing while
/// nobody watches.
class ViewDesk final : public CameraViews {
 public:
  ViewDesk(TagSetConfig tags, DetectorConfig detector, const Clock& clock);

  /// Before anything runs. @return for the worker of that body
  [[nodiscard]] BodyViews add(int body_id, const BodySensors& sensors);
  /// Makes pictures until stopped.
  void run(std::stop_token stop);
  /// Of all that was seen and not looked at yet: what `run` does when the bell has rung.
  void make_pictures();
  /// So many were made.
  [[nodiscard]] std::uint64_t pictures() const { return pictures_; }

  [[nodiscard]] const std::vector<Camera>& cameras() const override { return cameras_; }
  void watch(std::size_t camera, const std::optional<ViewWish>& wish) override;
  [[nodiscard]] Picture take(std::size_t camera) override;

 private:
  void make_picture(CameraPost& post, const Camera& camera, const ViewWish& wish);
  void look_for_candidates(const CameraView& view, bool wanted);

  std::vector<Camera> cameras_;
  TagSetConfig tags_;
  DetectorConfig detector_;
  const Clock& clock_;
  std::vector<std::unique_ptr<CameraPost>> posts_;
  Doorbell bell_;
  std::unique_ptr<CandidateSearch> candidate_search_;  ///< Made when it is wanted first.
  std::vector<TagCandidate> candidates_;
  GrayImage scaled_;
  std::vector<float> sums_;
  std::vector<std::uint8_t> jpeg_;
  std::atomic<std::uint64_t> pictures_{0};
};

}  // namespace fiducap
