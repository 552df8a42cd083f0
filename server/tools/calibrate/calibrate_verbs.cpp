#include "tools/calibrate/calibrate_verbs.hpp"

#include <CLI/CLI.hpp>

#include "tools/positive_number.hpp"

namespace fiducap {
namespace {

void add_imu(CLI::App& calibrate, CalibrateImuArguments& a, ChosenVerb& chosen) {
  auto* verb = calibrate.add_subcommand(
      "imu",
      "IMU noise from a recording at rest (Allan deviation, white noise, bias walk); with --poses "
      "bias, scale and misalignment from many attitudes");
  verb->add_option("RECORDING", a.recording,
                   "Folder in the EuRoC/ASL layout; mav0/imu0/data.csv is enough")
      ->required();
  verb->add_option("--out", a.out, "Folder for imu.yaml and allan.svg, or imu_correction.yaml")
      ->capture_default_str();
  auto* poses = verb->add_flag("--poses", a.poses,
                               "The IMU was put down in 20 to 40 attitudes, two seconds each, and "
                               "turned by hand between them");
  verb->add_option("--gravity", a.gravity_m_s2, "Where it was recorded, m/s²")
      ->check(kPositive)
      ->needs(poses)
      ->capture_default_str();
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Record: let the IMU warm up, put it on a solid table away from fans, and do not touch the "
      "table for 10 minutes\n"
      "at least; an hour shows the bias walk of a good gyro. A recording in which it moved is "
      "refused.\n"
      "Then: bodies: kalibr_imu: calibration/imu.yaml\n"
      "Example:\n  fiducap calibrate imu recordings/still --out calibration");
  verb->callback([&] { chosen = [&](const Terminal& t) { return run_calibrate_imu(a, t); }; });
}

void add_extrinsics(CLI::App& calibrate, CalibrateExtrinsicsArguments& a, ChosenVerb& chosen) {
  auto* verb = calibrate.add_subcommand("extrinsics",
                                        "Where the camera sits on the IMU, and how far their "
                                        "clocks are apart, from a waving recording");
  verb->add_option("RECORDING", a.recording,
                   "Folder in the EuRoC/ASL layout with camera, IMU and tags")
      ->required();
  verb->add_option("--out", a.out, "Folder for camchain-imucam.yaml")->capture_default_str();
  verb->add_option("--prior-mm", a.prior_mm, "How far the recording's T_BS may be off, per axis")
      ->check(kPositive)
      ->capture_default_str();
  verb->add_option("--prior-deg", a.prior_deg, "The same for its rotation")
      ->check(kPositive)
      ->capture_default_str();
  verb->add_flag("--keep-time", a.keep_time, "Do not search the time offset");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Record: rest for 2 s, then wave the robot for 60 s in front of three or more tags, near "
      "enough to fill the image:\n"
      "turn to and fro about all three axes, quickly but without blur, and move it to all sides. "
      "Tags always in view.\n"
      "cam0/sensor.yaml needs intrinsics and a rough T_BS; imu0/sensor.yaml the IMU's noise "
      "(fiducap calibrate imu).\n"
      "Then: bodies: cameras: calibration: calibration/camchain-imucam.yaml\n"
      "Example:\n  fiducap calibrate extrinsics recordings/waving --out calibration");
  verb->callback(
      [&] { chosen = [&](const Terminal& t) { return run_calibrate_extrinsics(a, t); }; });
}

void add_camera_target_options(CLI::App& verb, CalibrateCameraArguments& a) {
  auto* board =
      verb.add_option("--checkerboard", a.checkerboard,
                      "COLUMNSxROWS of inner corners, e.g. 9x6; without it tags are looked for");
  verb.add_option("--square-mm", a.square_mm, "Of the checkerboard; changes no intrinsics")
      ->check(kPositive)
      ->capture_default_str();
  verb.add_option("--tag-mm", a.tag_mm,
                  "Edge of the tags, all alike; changes no intrinsics. Default: what a recording "
                  "says, else 160")
      ->check(kPositive)
      ->excludes(board);
  verb.add_option("--family", a.family, "Tag family; default: what a recording says, else tag36h11")
      ->excludes(board);
  verb.add_flag("--loose", a.loose,
                "The tags are moved relative to each other while recording (found out by itself, "
                "but slowly)");
}

void add_corner_options(CLI::App& verb, CLI::Option& input, CalibrateCameraArguments& a) {
  auto* corners = verb.add_option("--corners", a.corners,
                                  "Instead of INPUT: CSV of corners that another program found "
                                  "(image,tag,corner,u,v or image,point,u,v)")
                      ->excludes(&input);
  verb.add_option("--board", a.board,
                  "What the corners are of: tags:MM, points:COLUMNSxROWS:MM, "
                  "charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM[:white], "
                  "grid:COLUMNSxROWS:TAG_MM:GAP_MM; default: tags of --tag-mm")
      ->needs(corners);
  verb.add_option("--size", a.size, "Of the images, WIDTHxHEIGHT, e.g. 1280x720")->needs(corners);
  verb.add_option("--set", a.set, "Of a file of corners with several sets")->needs(corners);
}

void add_camera(CLI::App& calibrate, CalibrateCameraArguments& a, ChosenVerb& chosen) {
  auto* verb = calibrate.add_subcommand("camera",
                                        "Focal length, principal point and distortion of a camera, "
                                        "from pictures of tags or of a checkerboard");
  auto* input = verb->add_option(
      "INPUT", a.input,
      "Folder of pictures, video file, or recording (EuRoC/ASL layout, images or corners)");
  add_corner_options(*verb, *input, a);
  add_camera_target_options(*verb, a);
  verb->add_option("--lens", a.lens, "auto tries both and takes the one that explains the pictures")
      ->check(CLI::IsMember({"auto", "radial-tangential", "equidistant"}))
      ->capture_default_str();
  verb->add_option("--camera", a.camera, "Which camera of a recording or of a file of corners")
      ->check(CLI::Range(0, 63))
      ->capture_default_str();
  verb->add_option("--views", a.views, "Most pictures used, those that differ most")
      ->check(CLI::Range(5, 2000))
      ->capture_default_str();
  verb->add_option("--out", a.out, "Folder for camera.yaml and camera.svg")->capture_default_str();
  verb->add_flag("--force", a.force, "Write camera.yaml although the verdict refuses it");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Record: any tags that stand still (a sheet of `fiducap tags sheet` on a flat board, tags on "
      "a wall; nobody needs to\n"
      "know their places), or a checkerboard. Fix focus, zoom and exposure. Bring the target to "
      "all parts of the image,\n"
      "corners too, near enough to fill it, tilted by 30° to 50° to all sides. Hold still for each "
      "picture, light the room:\n"
      "blur and rolling shutters spoil corners. 50 different views are plenty. Then look at "
      "camera.svg.\n"
      "Exit code 1 and no camera.yaml when the result is refused; verdict `weak` says what to do "
      "better.\n"
      "Then: bodies: cameras: calibration: calibration/camera.yaml\n"
      "Example:\n  fiducap calibrate camera pictures/ --tag-mm 80\n"
      "  fiducap calibrate camera board.mp4 --checkerboard 9x6 --square-mm 30 --out calibration\n"
      "  fiducap calibrate camera --corners corners.csv --board charuco:5x7:36.2:18.3 --size "
      "1600x1200");
  verb->callback([&] { chosen = [&](const Terminal& t) { return run_calibrate_camera(a, t); }; });
}

}  // namespace

void add_calibrate(CLI::App& app, CalibrateArguments& arguments, ChosenVerb& chosen) {
  auto* calibrate =
      app.add_subcommand("calibrate", "Camera lens, IMU noise, and camera to IMU, from recordings");
  calibrate->require_subcommand(1);
  calibrate->footer(
      "Example:\n  fiducap calibrate camera pictures/\n  fiducap calibrate imu recordings/still\n  "
      "fiducap calibrate extrinsics recordings/waving");
  add_camera(*calibrate, arguments.camera, chosen);
  add_imu(*calibrate, arguments.imu, chosen);
  add_extrinsics(*calibrate, arguments.extrinsics, chosen);
}

}  // namespace fiducap
