#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "base/handover.hpp"
#include "base/time.hpp"
#include "detection/candidate_search.hpp"
#include "pipeline/body_pipeline.hpp"
#include "pipeline/camera_view.hpp"
#include "streaming/page_api.hpp"

namespace fiducap {

/// The newest image of one camera, passed without locks: the body's worker writes what was seen,
/// the thread of the previews encodes it, the pages' thread fetches the picture.
class LatestImage final {
 public:
  /// From the pages' thread. @param request  nullopt: no viewer
  void watch(const std::optional<ViewRequest>& request) {
    request_.store(request ? packed(*request) : 0, std::memory_order_relaxed);
  }
  /// From any thread. nullopt: no viewer.
  [[nodiscard]] std::optional<ViewRequest> request() const {
    const std::uint64_t word = request_.load(std::memory_order_relaxed);
    if (word == 0) return std::nullopt;
    return ViewRequest{static_cast<int>(word >> 16), static_cast<int>(word >> 2 & 0xff),
                       (word & 2) != 0};
  }

  NewestValue<CameraView> seen;            ///< Worker → previews.
  NewestValue<CameraViews::Picture> made;  ///< Previews → pages.

 private:
  [[nodiscard]] static std::uint64_t packed(const ViewRequest& request) {
    return static_cast<std::uint64_t>(request.width_px) << 16 |
           static_cast<std::uint64_t>(request.per_second) << 2 | (request.candidates ? 2 : 0) | 1;
  }

  std::atomic<std::uint64_t> request_{0};
};

/// Wakes a waiting thread without a lock.
class WakeSignal final {
 public:
  void notify() noexcept {
    count_.fetch_add(1, std::memory_order_release);
    count_.notify_one();
  }
  /// @param seen  count at the last call   @return present count
  [[nodiscard]] std::uint32_t wait(std::uint32_t seen) const {
    count_.wait(seen, std::memory_order_acquire);
    return count_.load(std::memory_order_acquire);
  }

 private:
  std::atomic<std::uint32_t> count_{0};
};

/// A body's part of the previews, on its worker's thread: passes on images of watched cameras, at
/// most at the requested rate. Without a viewer it reads one number per image. Allocates nothing
/// after warm-up; keeps at most two images per camera.
class BodyViews final {
 public:
  /// @param cameras  of the body, in its order   All outlive this.
  BodyViews(std::vector<LatestImage*> cameras, WakeSignal& wake)
      : cameras_(cameras.size()), wake_(&wake) {
    for (std::size_t i = 0; i < cameras.size(); ++i) cameras_[i].latest = cameras[i];
  }

  /// Before the pipeline takes the sample, and with it the image.
  void note(const SensorSample& sample);
  /// After. @param map  of the pipeline
  void show(const BodyPipeline& pipeline, const BodyUpdate& update, const TagMap& map);

 private:
  struct Camera {
    LatestImage* latest{};
    std::optional<Instant> due_at;   ///< The next view.
    std::optional<Instant> last_at;  ///< The last image.
    double period_s{0};              ///< Of the images, smoothed; 0: not known.
  };
  void note(int camera, Instant at, const std::shared_ptr<const GrayImage>& image);

  std::vector<Camera> cameras_;
  WakeSignal* wake_;
  Camera* chosen_{nullptr};  ///< Whose image is to be shown.
  std::shared_ptr<const GrayImage> image_;
};

/// Pictures of all cameras, between the bodies' workers and the pages. `run` is a background
/// thread; it holds no lock of other threads and does nothing without a viewer.
class CameraPreview final : public CameraViews {
 public:
  CameraPreview(TagSetConfig tags, DetectorConfig detector, const Clock& clock);

  /// Before any thread runs. @return for the worker of that body
  [[nodiscard]] BodyViews add(int body_id, const BodySensors& sensors);
  /// Makes pictures until stopped.
  void run(std::stop_token stop);
  /// Of all new images: one round of `run`.
  void make_pictures();
  /// Number of pictures so far.
  [[nodiscard]] std::uint64_t pictures() const { return pictures_; }

  [[nodiscard]] const std::vector<Camera>& cameras() const override { return cameras_; }
  void watch(std::size_t camera, const std::optional<ViewRequest>& request) override;
  [[nodiscard]] Picture take(std::size_t camera) override;

 private:
  void make_picture(LatestImage& latest, const Camera& camera, const ViewRequest& request);

  std::vector<Camera> cameras_;
  TagSetConfig tags_;
  DetectorConfig detector_;
  const Clock& clock_;
  std::vector<std::unique_ptr<LatestImage>> latest_;
  WakeSignal wake_;
  std::unique_ptr<CandidateSearch> candidate_search_;  ///< Made on first use.
  std::vector<TagCandidate> candidates_;
  GrayImage scaled_;
  std::vector<float> sums_;
  std::vector<std::uint8_t> jpeg_;
  std::atomic<std::uint64_t> pictures_{0};
};

}  // namespace fiducap
