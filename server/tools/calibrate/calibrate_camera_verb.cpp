#include <filesystem>
#include <tuple>

#include <nlohmann/json.hpp>

#include "base/whole_file.hpp"
#include "calibration/intrinsics/view_collector.hpp"
#include "tools/calibrate/calibrate.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

constexpr double kUsualTag_mm = 160;

const std::string& input_of(const CalibrateCameraArguments& arguments) {
  return arguments.corners.empty() ? arguments.input : arguments.corners;
}

Expected<CollectedViews> views_in_corners(const CalibrateCameraArguments& arguments) {
  CornerFileChoice choice;
  choice.path = arguments.corners;
  choice.camera = arguments.camera;
  choice.set = arguments.set;
  constexpr int kLargest_px = 65535;
  const auto fits = [](int n) { return n > 0 && n <= kLargest_px; };
  const auto size = pair_from(arguments.size);
  if (!size || !fits(size->first) || !fits(size->second))
    return fail(ErrorCode::kInvalid,
                "must be WIDTHxHEIGHT of the images in pixels, e.g. 1280x720 (a file of corners "
                "does not have it); is '" +
                    arguments.size + "'",
                "--size");
  std::tie(choice.width, choice.height) = *size;
  choice.board.tag_m = (arguments.tag_mm > 0 ? arguments.tag_mm : kUsualTag_mm) / 1000;
  if (!arguments.board.empty()) {
    auto board = read_board(arguments.board);
    if (!board) return tl::unexpected(board.error());
    choice.board = std::move(*board);
  }
  auto data = read_corner_file(choice);
  if (!data) return tl::unexpected(data.error());
  const std::size_t images = data->views.size();
  return CollectedViews{std::move(*data), images, {}};
}

Expected<CameraOutcome> calibrate(const CalibrateCameraArguments& arguments,
                                  const Terminal& terminal) {
  ProgressLine line(terminal);
  if (arguments.input.empty() && arguments.corners.empty())
    return fail(ErrorCode::kInvalid,
                "needs pictures, a video or a recording, or --corners with a CSV file",
                "calibrate camera");
  const auto seen =
      arguments.corners.empty() ? views_in_images(arguments, line) : views_in_corners(arguments);
  if (!seen) return tl::unexpected(seen.error());
  const auto data = select_views(seen->data, static_cast<std::size_t>(arguments.views));
  IntrinsicsOptions options;
  if (arguments.lens == "equidistant") options.lenses = {Distortion::kEquidistant};
  if (arguments.lens == "radial-tangential") options.lenses = {Distortion::kRadialTangential};
  if (arguments.lens == "rational") options.lenses = {Distortion::kRational};
  options.join_targets = !arguments.loose;
  auto result =
      calibrate_intrinsics(data, options, [&](const std::string& what) { line.show(what); });
  if (!result) return tl::unexpected(in_context(result.error(), input_of(arguments)));
  CameraOutcome out{seen->images, seen->data.views.size(), std::move(*result), {}, {}};
  out.map = make_image_map(out.calibration);
  out.verdict = assess(out.calibration, out.map);
  return out;
}

void add_camera_target_options(CLI::App& verb, CalibrateCameraArguments& a) {
  auto* board =
      verb.add_option("--checkerboard", a.checkerboard,
                      "COLUMNSxROWS of inner corners, e.g. 9x6; without it tags are looked for");
  add_positive(verb, "--square-mm", a.square_mm, "Of the checkerboard; changes no intrinsics");
  add_positive(verb, "--tag-mm", a.tag_mm,
               "Edge of all tags; changes no intrinsics. Default: as in the recording, else 160")
      ->excludes(board);
  verb.add_option("--family", a.family, "Tag family; default: as in the recording, else tag36h11")
      ->excludes(board);
  verb.add_flag("--loose", a.loose,
                "The tags are moved relative to each other while recording (detected without it, "
                "too, but slowly)");
}

void add_corner_options(CLI::App& verb, CLI::Option& input, CalibrateCameraArguments& a) {
  auto* corners = verb.add_option("--corners", a.corners,
                                  "Instead of INPUT: CSV of corners that another program found "
                                  "(image,tag,corner,u,v or image,point,u,v)")
                      ->excludes(&input);
  verb.add_option("--board", a.board,
                  "The board: Kalibr's target.yaml, aprilgrid:COLUMNSxROWS:TAG_MM:SPACING, "
                  "points:COLUMNSxROWS:MM, charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM[:white], "
                  "grid:COLUMNSxROWS:TAG_MM:GAP_MM, or tags:MM; default: tags of --tag-mm")
      ->excludes("--checkerboard");
  verb.add_option("--size", a.size, "Of the images, WIDTHxHEIGHT, e.g. 1280x720")->needs(corners);
  verb.add_option("--set", a.set, "Of a file of corners with several sets")->needs(corners);
}

}  // namespace

int run_calibrate_camera(const CalibrateCameraArguments& arguments, const Terminal& terminal) {
  const auto outcome = calibrate(arguments, terminal);
  if (!outcome) return report(terminal, outcome.error());
  const std::filesystem::path out(arguments.out);
  const std::string plots = (out / "camera.html").string();
  const std::string file = (out / "camera.yaml").string();
  const bool refused = outcome->verdict.grade == IntrinsicsGrade::kUseless;
  const bool wanted = !refused || arguments.force;
  // Also when the result is refused: the old file does not belong to the new plots.
  keep_before(file, terminal);
  auto written = write_whole_file(plots, to_html(camera_plots(*outcome)));
  if (written && wanted)
    written = write_whole_file(file, to_camera_yaml(outcome->calibration, outcome->verdict));
  if (!written) return report(terminal, written.error());
  if (arguments.json)
    print_json(terminal, to_camera_json(*outcome));
  else
    print_camera_report(terminal, *outcome, input_of(arguments));
  if (!wanted)
    return report(terminal, {ErrorCode::kInvalid,
                             "no calibration written; " + plots +
                                 " shows what is missing (--force writes it anyway)",
                             input_of(arguments)});
  if (!arguments.json)
    terminal.out << "written: " << file << " (bodies: cameras: calibration), " << plots << "\n";
  return kExitOk;
}

void add_calibrate_camera(CLI::App& calibrate, ChosenVerb& chosen) {
  auto* verb = calibrate.add_subcommand("camera",
                                        "Focal length, principal point and distortion of a camera, "
                                        "from pictures of tags or of a checkerboard");
  auto& a = arguments_of<CalibrateCameraArguments>(*verb, chosen, run_calibrate_camera);
  auto* input = verb->add_option(
      "INPUT", a.input,
      "Folder of pictures, video file, or recording (EuRoC/ASL layout, images or corners)");
  add_camera_target_options(*verb, a);
  add_corner_options(*verb, *input, a);
  verb->add_option("--lens", a.lens,
                   "auto: radial-tangential or equidistant, which explains the pictures better")
      ->check(CLI::IsMember({"auto", "radial-tangential", "equidistant", "rational"}))
      ->capture_default_str();
  verb->add_option("--camera", a.camera, "Which camera of a recording or of a file of corners")
      ->check(CLI::Range(0, 63))
      ->capture_default_str();
  verb->add_option("--views", a.views, "Largest number of pictures used, those that differ most")
      ->check(CLI::Range(5, 2000))
      ->capture_default_str();
  verb->add_option("--out", a.out, "Folder for camera.yaml and camera.html")->capture_default_str();
  verb->add_flag("--force", a.force, "Write camera.yaml although the verdict refuses it");
  verb->add_flag("--json", a.json, "Numbers for scripts");
  verb->footer(
      "Record: any tags that stand still (a sheet of `fiducap tags sheet` on a flat board, tags on "
      "a wall; their places need\n"
      "not be known), or a checkerboard. Fix focus, zoom and exposure. Bring the target to "
      "all parts of the image,\n"
      "corners too, near enough to fill it, tilted by 30° to 50° to all sides. Hold still for each "
      "picture, light the room:\n"
      "blur and rolling shutters spoil corners. 50 different views are plenty. Then look at "
      "camera.html.\n"
      "Exit code 1 and no camera.yaml when the result is refused; verdict `weak` comes with "
      "advice.\n"
      "Then: bodies: cameras: calibration: calibration/camera.yaml\n"
      "Example:\n  fiducap calibrate camera pictures/ --tag-mm 80\n"
      "  fiducap calibrate camera board.mp4 --checkerboard 9x6 --square-mm 30 --out calibration\n"
      "  fiducap calibrate camera --corners corners.csv --board charuco:5x7:36.2:18.3 --size "
      "1600x1200");
}

void keep_before(const std::string& path, const Terminal& terminal) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) return;
  std::string kept = path + ".before";
  for (int n = 2; std::filesystem::exists(kept, failure); ++n)
    kept = path + ".before" + std::to_string(n);
  std::filesystem::rename(path, kept, failure);
  if (!failure) terminal.err << "the earlier " << path << " is kept as " << kept << "\n";
}

void add_calibrate(CLI::App& app, ChosenVerb& chosen) {
  auto* calibrate =
      app.add_subcommand("calibrate", "Camera lens, IMU noise, and camera to IMU, from recordings");
  calibrate->require_subcommand(1);
  calibrate->footer(
      "Example:\n  fiducap calibrate camera pictures/\n  fiducap calibrate imu recordings/still\n  "
      "fiducap calibrate extrinsics recordings/waving");
  add_calibrate_camera(*calibrate, chosen);
  add_calibrate_imu(*calibrate, chosen);
  add_calibrate_extrinsics(*calibrate, chosen);
}

}  // namespace fiducap
