#pragma once

#include <string>

#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

/// What a run of `fiducap calibrate camera` has to show.
struct CameraOutcome {
  std::size_t images{};
  std::size_t with_target{};
  IntrinsicsCalibration calibration;
  ImageMap map;
  IntrinsicsVerdict verdict;
};

/// For scripts.
[[nodiscard]] std::string to_camera_json(const CameraOutcome& outcome);
/// For people.
void print_camera_report(const Terminal& terminal, const CameraOutcome& outcome,
                         const std::string& input);

/// EuRoC's sensor.yaml without a place on a body, as read_camera_calibration reads it; comments say
/// how sure it is.
[[nodiscard]] std::string to_camera_yaml(const IntrinsicsCalibration& calibration,
                                         const IntrinsicsVerdict& verdict);

}  // namespace fiducap
