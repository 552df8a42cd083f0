#include <CLI/CLI.hpp>

#include "tools/import/import_command.hpp"
#include "tools/positive_number.hpp"

namespace fiducap {

void add_import(CLI::App& app, ImportArguments& a, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "import",
      "Make a recording of what another program recorded: bags of ROS 1 and 2, MCAP, a video with "
      "an IMU's table, EuRoC folders, phones (Sensor Logger)");
  verb->add_option("SOURCE", a.source,
                   "A .bag, .db3, .mcap, .zip or video file, or a folder of rosbag2, EuRoC or "
                   "Sensor Logger")
      ->required();
  verb->add_option("--out", a.out, "New folder for the recording; without it only look");
  verb->add_option("--image", a.images,
                   "Images to take; several times for several cameras of one body")
      ->allow_extra_args(false);
  verb->add_option("--imu", a.imu, "IMU to take, or 'none'; beside a video: its table, a CSV file");
  verb->add_option("--calibration", a.calibrations,
                   "Lens, place or noise: a file per camera in their order (OpenCV, ROS, EuRoC), "
                   "Kalibr's camchain, Kalibr's imu.yaml")
      ->allow_extra_args(false);
  verb->add_option("--tag-size", a.tag_size_m, "Edge between black and white border, metres")
      ->check(kPositive);
  verb->add_option("--tag-family", a.tag_family, "Tag family, e.g. tag36h11");
  verb->add_option("--stamps", a.stamps, "When a sample was true: 'header' or 'log'")
      ->check(CLI::IsMember({"header", "log"}))
      ->capture_default_str();
  verb->add_option("--imu-offset", a.imu_offset_s, "Seconds to add to the stamps of the IMU");
  verb->add_option("--imu-columns", a.imu_columns,
                   "Of a table: the names of time, gyro x y z, accelerometer x y z");
  verb->add_option("--imu-units", a.imu_units, "Of a table: e.g. us,deg/s,g");
  verb->add_flag("--json", a.json, "What was found and written, for scripts");
  verb->footer(
      "Example:\n"
      "  fiducap import flight.bag\n"
      "  fiducap import flight.bag --out recordings/flight --image /cam0/image_raw --imu /imu0 "
      "--tag-size 0.16\n"
      "  fiducap import walk.mp4 --imu walk.csv --imu-units ms,deg/s,g --out recordings/walk");
  verb->callback([&] { chosen = [&](const Terminal& t) { return run_import(a, t); }; });
}

}  // namespace fiducap
