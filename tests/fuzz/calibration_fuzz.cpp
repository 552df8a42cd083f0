// Calibrations of other programs. The first byte chooses: one camera, Kalibr's cameras, Kalibr's
// IMU.
#include "capture/lens/calibration_files.hpp"
#include "fuzz/memory_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace fiducap;
  static const fuzz::MemoryFile file;
  const fuzz::Chosen input(data, size, 3);
  file.put(input.bytes);
  if (input.which == 0) {
    if (const auto camera = read_camera_calibration(file.path()))
      fuzz::require(camera->check().empty());
  } else if (input.which == 1) {
    if (const auto cameras = read_kalibr_camchain(file.path())) {
      fuzz::require(!cameras->empty());
      for (const CameraMount& camera : *cameras) fuzz::require(camera.model.check().empty());
    }
  } else if (const auto imu = read_kalibr_imu(file.path())) {
    fuzz::require(std::isfinite(imu->gyro_noise_rad_s_rtHz));
  }
  return 0;
}
