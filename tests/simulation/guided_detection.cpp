#include "simulation/guided_detection.hpp"

#include "detection/observe.hpp"

namespace fiducap {

GuidedDetection::GuidedDetection(const std::string& filter, const BodySensors& sensors,
                                 const TagSetConfig& tags)
    : sensors_(sensors),
      tags_(tags),
      filter_(make_body_filter(filter, sensors, {}, {})),
      search_(sensors, tags, {}, {}) {}

SensorSample GuidedDetection::take(const SensorSample& sample) {
  if (const auto* imu = std::get_if<ImuSample>(&sample)) {
    filter_->propagate(*imu);
    search_.add_imu(*imu);
    return sample;
  }
  const auto* image = std::get_if<CameraFrame>(&sample);
  if (image == nullptr) return sample;
  CornerFrame found = search_.search(*image, beliefs_, map_);
  const auto camera = static_cast<std::size_t>(found.camera);
  observe(found, sensors_.cameras[camera].model, tags_, {}, seen_);
  (void)filter_->update(seen_, {});
  filter_->tag_beliefs(beliefs_);
  search_.corrected(*filter_,
                    filter_->running() ? std::optional(filter_->estimate()) : std::nullopt);
  return found;
}

}  // namespace fiducap
