#pragma once

#include <string>

#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CalibrateCameraArguments {
  std::string input;         ///< Folder of pictures, video file or recording.
  std::string checkerboard;  ///< COLUMNSxROWS of inner corners; empty: tags.
  double square_mm{30};
  double tag_mm{0};      ///< 0: what a recording says, else 160.
  std::string family{};  ///< Empty: what a recording says, else tag36h11.
  std::string lens{"auto"};
  bool loose{false};
  int camera{0};
  int views{120};
  std::string out{"calibration"};
  bool json{false};
};

/// `fiducap calibrate camera`: writes camera.yaml and camera.svg. @return exit code
[[nodiscard]] int run_calibrate_camera(const CalibrateCameraArguments& arguments,
                                       const Terminal& terminal);

/// EuRoC's sensor.yaml without a place on a body, as read_camera_calibration reads it; comments say
/// how sure it is.
[[nodiscard]] std::string to_camera_yaml(const IntrinsicsCalibration& calibration,
                                         const IntrinsicsVerdict& verdict);

}  // namespace fiducap
