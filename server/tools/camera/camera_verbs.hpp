#pragma once

#include <functional>
#include <string>

#include "capture/camera_device.hpp"
#include "capture/v4l2/camera_list.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CamerasArguments {
  bool json{false};
};

/// `fiducap cameras`: the connected cameras, their formats, controls and settings, and a section
/// for the configuration.
int run_cameras(const CamerasArguments& arguments, const Terminal& terminal,
                const CameraPlaces& places = {});

struct CaptureArguments {
  CameraDeviceConfig camera;
  std::string out;
  int pictures{0};    ///< 0: a recording.
  double seconds{0};  ///< Of a recording.
  double every_s{0};  ///< Between two pictures; 0: on Enter, once a second without a terminal.
  bool tags{false};   ///< Only pictures with tags that are sharp and differ.
  std::string family{"tag36h11"};
  std::string calibration;  ///< Of the lens, for a recording; empty: a guess.
  bool json{false};
};

using CameraOpener = std::function<OpenedSource(const CameraDeviceConfig&, const CameraModel&)>;

/// `fiducap capture`: pictures for a calibration, or a recording with images, of any camera that
/// the server can open. @param open  a replacement for tests
int run_capture(const CaptureArguments& arguments, const Terminal& terminal,
                const CameraOpener& open = {});

}  // namespace fiducap
