#include "tools/calibrate/calibrate_camera_command.hpp"

#include <charconv>
#include <filesystem>

#include "base/whole_file.hpp"
#include "detection/tag_family_list.hpp"
#include "tools/calibrate/calibration_picture.hpp"
#include "tools/calibrate/calibration_views.hpp"
#include "tools/calibrate/camera_report.hpp"
#include "tools/calibrate/corner_file.hpp"
#include "tools/calibrate/kept_file.hpp"

namespace fiducap {
namespace {

constexpr double kUsualTag_mm = 160;

/// "9x6" → columns and rows of inner corners.
Expected<Checkerboard> read_checkerboard(const CalibrateCameraArguments& arguments) {
  const std::string& text = arguments.checkerboard;
  Checkerboard board{0, 0, arguments.square_mm / 1000};
  const char* end = text.data() + text.size();
  const auto columns = std::from_chars(text.data(), end, board.columns);
  if (columns.ec == std::errc() && columns.ptr != end && *columns.ptr == 'x') {
    const auto rows = std::from_chars(columns.ptr + 1, end, board.rows);
    constexpr int kLeast = 3, kMost = 100;
    const auto fits = [](int n) { return n >= kLeast && n <= kMost; };
    if (rows.ec == std::errc() && rows.ptr == end && fits(board.columns) && fits(board.rows))
      return board;
  }
  return fail(ErrorCode::kInvalid,
              "must be COLUMNSxROWS of inner corners (one less than squares), 3 to 100 each, e.g. "
              "9x6; is '" +
                  text + "'",
              "--checkerboard");
}

Expected<CalibrationTargets> choose_targets(const CalibrateCameraArguments& arguments,
                                            const CalibrationImages& images) {
  CalibrationTargets targets;
  if (!arguments.checkerboard.empty()) {
    auto board = read_checkerboard(arguments);
    if (!board) return tl::unexpected(board.error());
    targets.checkerboard = *board;
    return targets;
  }
  targets.tags.size_m = kUsualTag_mm / 1000;
  if (const auto& recording = images.recording()) targets.tags = tags_of(*recording);
  if (arguments.tag_mm > 0) {
    targets.tags.size_m = arguments.tag_mm / 1000;
    targets.tags.sizes_m.clear();
  }
  if (!arguments.family.empty()) targets.tags.family = listed_tag_family(arguments.family);
  if (const auto faults = targets.tags.check(); !faults.empty())
    return fail(ErrorCode::kInvalid, faults.front().text());
  return targets;
}

IntrinsicsOptions options_of(const CalibrateCameraArguments& arguments) {
  IntrinsicsOptions options;
  if (arguments.lens == "equidistant") options.lenses = {Distortion::kEquidistant};
  if (arguments.lens == "radial-tangential") options.lenses = {Distortion::kRadialTangential};
  options.join_targets = !arguments.loose;
  return options;
}

const std::string& input_of(const CalibrateCameraArguments& arguments) {
  return arguments.corners.empty() ? arguments.input : arguments.corners;
}

Error nothing_seen(const CollectedViews& seen, const CalibrateCameraArguments& arguments) {
  const std::string target = arguments.checkerboard.empty()
                                 ? "no tag of 20 px or more (family, light, sharpness?)"
                                 : "no whole checkerboard of " + arguments.checkerboard +
                                       " inner corners (count them; all must be in view)";
  return {ErrorCode::kNotFound, target + " in " + std::to_string(seen.images) + " images",
          arguments.input};
}

Expected<CollectedViews> look_at_images(const CalibrateCameraArguments& arguments,
                                        ProgressLine& line) {
  auto images =
      CalibrationImages::open(arguments.input, static_cast<std::size_t>(arguments.camera));
  if (!images) return tl::unexpected(images.error());
  const auto targets = choose_targets(arguments, *images);
  if (!targets) return tl::unexpected(targets.error());
  const std::string of =
      images->total() > 0 ? " of " + std::to_string(images->total()) : std::string();
  auto seen = collect_views(*images, *targets, [&](std::size_t looked, std::size_t found) {
    line.show("looking for targets: " + std::to_string(looked) + of + " images, " +
              std::to_string(found) + " with");
  });
  if (seen && seen->data.views.empty()) return tl::unexpected(nothing_seen(*seen, arguments));
  return seen;
}

/// "1280x720" → width and height.
bool read_size(const std::string& text, int& width, int& height) {
  constexpr int kLargest_px = 65535;
  const char* end = text.data() + text.size();
  const auto w = std::from_chars(text.data(), end, width);
  if (w.ec != std::errc() || w.ptr == end || *w.ptr != 'x') return false;
  const auto h = std::from_chars(w.ptr + 1, end, height);
  const auto fits = [](int n) { return n > 0 && n <= kLargest_px; };
  return h.ec == std::errc() && h.ptr == end && fits(width) && fits(height);
}

Expected<CollectedViews> look_at_corners(const CalibrateCameraArguments& arguments) {
  CornerFileChoice choice;
  choice.path = arguments.corners;
  choice.camera = arguments.camera;
  choice.set = arguments.set;
  if (!read_size(arguments.size, choice.width, choice.height))
    return fail(ErrorCode::kInvalid,
                "must be WIDTHxHEIGHT of the images in pixels, e.g. 1280x720 (corners do not tell "
                "it); is '" +
                    arguments.size + "'",
                "--size");
  choice.board.tag_m = (arguments.tag_mm > 0 ? arguments.tag_mm : kUsualTag_mm) / 1000;
  if (!arguments.board.empty()) {
    auto board = read_board_description(arguments.board);
    if (!board) return tl::unexpected(board.error());
    choice.board = std::move(*board);
  }
  auto data = read_corner_file(choice);
  if (!data) return tl::unexpected(data.error());
  CollectedViews seen;
  seen.images = data->views.size();
  seen.data = std::move(*data);
  return seen;
}

Expected<CameraOutcome> calibrate(const CalibrateCameraArguments& arguments,
                                  const Terminal& terminal) {
  ProgressLine line(terminal);
  if (arguments.input.empty() && arguments.corners.empty())
    return fail(ErrorCode::kInvalid,
                "needs pictures, a video or a recording, or --corners with a CSV file",
                "calibrate camera");
  const auto seen =
      arguments.corners.empty() ? look_at_images(arguments, line) : look_at_corners(arguments);
  if (!seen) return tl::unexpected(seen.error());
  const auto data = select_views(seen->data, static_cast<std::size_t>(arguments.views));
  auto result = calibrate_intrinsics(data, options_of(arguments),
                                     [&](const std::string& what) { line.show(what); });
  if (!result) {
    Error error = result.error();
    if (error.context.empty()) error.context = input_of(arguments);
    return tl::unexpected(error);
  }
  CameraOutcome out{seen->images, seen->data.views.size(), std::move(*result), {}, {}};
  out.map = make_image_map(out.calibration);
  out.verdict = judge(out.calibration, out.map);
  return out;
}

}  // namespace

int run_calibrate_camera(const CalibrateCameraArguments& arguments, const Terminal& terminal) {
  const auto outcome = calibrate(arguments, terminal);
  if (!outcome) return report(terminal, outcome.error());
  const std::filesystem::path out(arguments.out);
  const std::string picture = (out / "camera.svg").string();
  const std::string file = (out / "camera.yaml").string();
  const bool refused = outcome->verdict.grade == IntrinsicsGrade::kUseless;
  const bool wanted = !refused || arguments.force;
  keep_before(file, terminal);  // also where this one is refused: it would stand beside its picture
  auto written = write_whole_file(
      picture, calibration_svg(outcome->calibration, outcome->map, outcome->verdict));
  if (written && wanted)
    written = write_whole_file(file, to_camera_yaml(outcome->calibration, outcome->verdict));
  if (!written) return report(terminal, written.error());
  if (arguments.json)
    terminal.out << to_camera_json(*outcome);
  else
    print_camera_report(terminal, *outcome, input_of(arguments));
  if (!wanted)
    return report(terminal, {ErrorCode::kInvalid,
                             "no calibration written; " + picture +
                                 " shows what is missing (--force writes it all the same)",
                             input_of(arguments)});
  if (!arguments.json)
    terminal.out << "written: " << file << " (bodies: cameras: calibration), " << picture << "\n";
  return kExitOk;
}

}  // namespace fiducap
