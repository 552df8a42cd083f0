#include "tools/camera/camera_verbs.hpp"

#include <CLI/CLI.hpp>

#include "tools/positive_number.hpp"

namespace fiducap {
namespace {

void add_cameras(CLI::App& app, CamerasArguments& arguments, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "cameras", "Which cameras are plugged in, what can they do, what to write about them");
  verb->add_flag("--json", arguments.json, "One JSON object for scripts");
  verb->footer(
      "Formats, sizes and promised rates, controls with their values, the name that stays the same "
      "after a restart, and a section for the configuration of fiducapd. Running cameras are not "
      "disturbed.\nExample:\n  fiducap cameras\n"
      "  fiducap cameras --json | jq '.cameras[].lasting_name'");
  verb->callback([&] { chosen = [&](const Terminal& t) { return run_cameras(arguments, t); }; });
}

void add_camera_options(CLI::App& verb, CameraDeviceConfig& camera) {
  verb.add_option("--camera", camera.open,
                  "/dev/videoN or N, a name of /dev/v4l/by-id, libcamera:, rtsp://…, a GStreamer "
                  "pipeline or a video")
      ->required();
  verb.add_option("--width", camera.width, "Asked of the camera; with --height");
  verb.add_option("--height", camera.height, "Asked of the camera; with --width");
  verb.add_option("--rate", camera.rate_hz, "Images a second asked of the camera")
      ->check(kPositive);
  verb.add_option("--format", camera.format, "GREY, MJPEG, YUYV, …; auto: the quickest")
      ->capture_default_str();
  verb.add_option("--exposure", camera.exposure_s, "Seconds; else as it is")->check(kPositive);
  verb.add_option("--gain", camera.gain, "auto, or a number of the camera")->capture_default_str();
  verb.add_option("--focus", camera.focus, "auto, or a number of the camera")
      ->capture_default_str();
}

void add_capture(CLI::App& app, CaptureArguments& arguments, ChosenVerb& chosen) {
  auto* verb =
      app.add_subcommand("capture", "Take pictures for a calibration, or a recording with images");
  auto& a = arguments;
  add_camera_options(*verb, a.camera);
  verb->add_option("--out", a.out, "New folder")->required();
  auto* pictures = verb->add_option("--pictures", a.pictures,
                                    "So many; each on Enter, without a terminal once a second")
                       ->check(kPositive);
  verb->add_option("--seconds", a.seconds, "A recording so long")
      ->check(kPositive)
      ->excludes(pictures);
  verb->add_option("--every", a.every_s, "Seconds between two pictures")->check(kPositive);
  verb->add_flag("--tags", a.tags,
                 "Take pictures by itself: those with tags that are sharp and differ");
  verb->add_option("--family", a.family, "Tag family")->capture_default_str();
  verb->add_option("--calibration", a.calibration,
                   "Of the lens, for a recording; without it the lens is a guess");
  verb->add_flag("--json", a.json, "What was taken, for scripts");
  verb->footer(
      "For a calibration: a sheet of tags (fiducap tags sheet) on a flat wall, the camera moved "
      "around it, near and far, tilted, until tags were in every corner of the image.\n"
      "Example:\n  fiducap capture --camera 0 --out lens_pictures --pictures 40 --tags\n"
      "  fiducap calibrate camera lens_pictures --out lens\n"
      "  fiducap capture --camera 0 --out recordings/hall --seconds 30 --calibration "
      "lens/camera.yaml");
  verb->callback([&] { chosen = [&](const Terminal& t) { return run_capture(a, t); }; });
}

}  // namespace

void add_camera_verbs(CLI::App& app, CameraArguments& arguments, ChosenVerb& chosen) {
  add_cameras(app, arguments.cameras, chosen);
  add_capture(app, arguments.capture, chosen);
}

}  // namespace fiducap
