#include "capture/import/calibration_files.hpp"

#include <algorithm>

#include "base/yaml_section.hpp"
#include "capture/lens/camera_calibration_file.hpp"
#include "capture/lens/kalibr_file.hpp"

namespace fiducap {
namespace {

Expected<void> require_size(const CameraModel& model, const FoundStream& camera,
                            const std::string& file) {
  const CameraModel& images = camera.mount.model;
  if (images.width == 0 || (images.width == model.width && images.height == model.height))
    return {};
  return fail(ErrorCode::kInvalid,
              "is for images of " + std::to_string(model.width) + " x " +
                  std::to_string(model.height) + ", those of " + camera.name + " are " +
                  std::to_string(images.width) + " x " + std::to_string(images.height),
              file);
}

Expected<void> apply_camchain(const std::string& file, std::vector<FoundStream>& cameras) {
  const auto mounts = read_kalibr_camchain(file);
  if (!mounts) return tl::unexpected(mounts.error());
  for (std::size_t k = 0; k < std::min(mounts->size(), cameras.size()); ++k) {
    FoundStream& camera = cameras[k];
    const CameraMount& said = (*mounts)[k];
    if (const auto fits = require_size(said.model, camera, file); !fits) return fits;
    camera.mount.model = said.model;
    camera.mount.X_BV = said.X_BV;
    camera.mount.time_shift = said.time_shift;
    camera.lens_known = camera.place_known = true;
  }
  return {};
}

Expected<void> apply_to_camera(const std::string& file, FoundStream& camera) {
  const auto mount = read_camera_calibration(file, camera.mount);
  if (!mount) return tl::unexpected(mount.error());
  if (const auto fits = require_size(mount->model, camera, file); !fits) return fits;
  camera.mount = *mount;
  camera.lens_known = true;
  const auto yaml = YamlSection::load(file);
  if (!yaml || !yaml->has("T_BS")) return {};
  const auto X_BV = yaml->pose("T_BS");
  if (const auto sound = yaml->check(); !sound) return sound;
  camera.mount.X_BV = *X_BV;
  camera.place_known = true;
  return {};
}

}  // namespace

Expected<void> apply_calibrations(const std::vector<std::string>& files,
                                  std::vector<FoundStream>& cameras,
                                  std::optional<ImuNoise>& noise) {
  std::size_t next = 0;
  for (const std::string& file : files) {
    const auto yaml = YamlSection::load(file);
    if (!yaml) return tl::unexpected(yaml.error());
    if (yaml->has("cam0")) {
      if (const auto done = apply_camchain(file, cameras); !done) return done;
    } else if (yaml->has("imu0") || yaml->has("gyroscope_noise_density")) {
      const auto said = read_kalibr_imu(file);
      if (!said) return tl::unexpected(said.error());
      noise = *said;
    } else if (next < cameras.size()) {
      if (const auto done = apply_to_camera(file, cameras[next]); !done) return done;
      ++next;
    } else {
      return fail(
          ErrorCode::kInvalid,
          "is one calibration more than there are cameras (" + std::to_string(cameras.size()) + ")",
          file);
    }
  }
  return {};
}

}  // namespace fiducap
