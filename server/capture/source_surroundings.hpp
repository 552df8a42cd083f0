#pragma once

#include <vector>

#include "capture/lens/camera_model.hpp"

namespace fiducap {

/// What a configuration says of a body beside its source, as far as sources have rules about it.
struct SourceSurroundings {
  std::vector<CameraMount> cameras;  ///< As configured; files are not read yet.
  bool calibrated_by_files{false};   ///< Some of the cameras.
  bool has_imu{false};               ///< An IMU is described.
  bool has_imu_source{false};        ///< The IMU has a source of its own.
  std::vector<bool> has_source{};    ///< Which of the cameras have one of their own.
};

}  // namespace fiducap
