#pragma once

#include <functional>
#include <memory>
#include <string>

#include "capture/camera_device.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CaptureArguments {
  CameraDeviceConfig camera;
  std::string out;
  int pictures{0};    ///< 0: a recording.
  double seconds{0};  ///< Of a recording.
  double every_s{0};  ///< Between two pictures; 0: on Enter, when a person sits there.
  bool tags{false};   ///< Only pictures with tags that are sharp and differ.
  std::string family{"tag36h11"};
  std::string calibration;  ///< Of the lens, for a recording; empty: a guess.
  bool json{false};
};

using CameraOpener = std::function<Expected<std::unique_ptr<SensorSource>>(
    const CameraDeviceConfig&, const CameraModel&)>;

/// `fiducap capture`: pictures for a calibration, or a recording with images, of any camera that
/// the server can open. @param open  another one for tests
int run_capture(const CaptureArguments& arguments, const Terminal& terminal,
                const CameraOpener& open = {});

}  // namespace fiducap
