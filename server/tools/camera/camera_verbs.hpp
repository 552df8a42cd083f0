#pragma once

#include "tools/camera/cameras_command.hpp"
#include "tools/camera/capture_command.hpp"
#include "tools/terminal.hpp"

namespace CLI {
class App;
}

namespace fiducap {

struct CameraArguments {
  CamerasArguments cameras;
  CaptureArguments capture;
};

/// Adds `fiducap cameras` and `fiducap capture`. @param arguments, chosen  outlive `app`
void add_camera_verbs(CLI::App& app, CameraArguments& arguments, ChosenVerb& chosen);

}  // namespace fiducap
