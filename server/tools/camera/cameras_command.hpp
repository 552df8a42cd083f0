#pragma once

#include "capture/v4l2/camera_list.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CamerasArguments {
  bool json{false};
};

/// `fiducap cameras`: what is plugged in, what it can do, how it is set, and what to write into the
/// configuration.
int run_cameras(const CamerasArguments& arguments, const Terminal& terminal,
                const CameraPlaces& places = {});

}  // namespace fiducap
