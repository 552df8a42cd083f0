#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/expected.hpp"
#include "base/gravity.hpp"
#include "calibration/imu/imu_calibration.hpp"
#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "calibration/intrinsics/view_collector.hpp"
#include "detection/no_tag.hpp"
#include "tools/plot/plot_page.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct CalibrateCameraArguments {
  std::string input;         ///< Folder of pictures, video file or recording; empty with `corners`.
  std::string corners{};     ///< CSV of corners that another program found, see CornerFileChoice.
  std::string board{};       ///< Target of images or corners, see read_board; empty: tags.
  std::string size{};        ///< Of the images of `corners`, WIDTHxHEIGHT.
  std::string set{};         ///< Of a file of corners that holds several.
  std::string checkerboard;  ///< COLUMNSxROWS of inner corners; empty: tags.
  double square_mm{30};
  double tag_mm{0};      ///< 0: as in the recording, else 160.
  std::string family{};  ///< Empty: as in the recording, else tag36h11.
  std::string lens{"auto"};
  bool loose{false};
  int camera{0};
  int views{120};
  std::string out{"calibration"};
  bool force{false};  ///< Write camera.yaml although the verdict refuses it.
  bool json{false};
};

struct CalibrateImuArguments {
  std::string recording;
  std::string out{"calibration"};
  bool json{false};
  bool poses{false};  ///< Many attitudes at rest instead of one: bias, scale, misalignment.
  double gravity_m_s2{kUsualGravity_m_s2};
};

struct CalibrateExtrinsicsArguments {
  std::string recording;
  std::string out{"calibration"};
  double prior_mm{20};
  double prior_deg{2};
  bool keep_time{false};
  bool json{false};
};

/// `fiducap calibrate camera`: writes camera.yaml and camera.html. @return exit code
[[nodiscard]] int run_calibrate_camera(const CalibrateCameraArguments& arguments,
                                       const Terminal& terminal);
/// `fiducap calibrate imu`: writes imu.yaml and allan.html, with `poses` imu_correction.yaml.
/// @return exit code
[[nodiscard]] int run_calibrate_imu(const CalibrateImuArguments& arguments,
                                    const Terminal& terminal);
/// `fiducap calibrate extrinsics`: writes camchain-imucam.yaml. @return exit code
[[nodiscard]] int run_calibrate_extrinsics(const CalibrateExtrinsicsArguments& arguments,
                                           const Terminal& terminal);

/// Renames the file at `path`, if there is one, to `path.before` (`.before2`, … when that exists)
/// and reports it: it may be of another camera.
void keep_before(const std::string& path, const Terminal& terminal);

// ---- Input and output of `fiducap calibrate camera`.

/// The images of a calibration and their views.
struct CollectedViews {
  CalibrationData data;  ///< A view per image with a target.
  std::size_t images{};  ///< Searched.
  FewImages few;         ///< Of those.
};

/// Searches all images of `arguments.input` for the targets: a folder of pictures, a video file, or
/// a recording. Pictures that cannot be read are left out and logged.
/// @return Error also when no image shows a target
[[nodiscard]] Expected<CollectedViews> views_in_images(const CalibrateCameraArguments& arguments,
                                                       ProgressLine& line);

/// The two numbers of `9x6`; nullopt for another format.
[[nodiscard]] std::optional<std::pair<int, int>> pair_from(std::string_view text);

/// `tags:MM` – tags of this edge, at unknown places, fixed while recording.
/// `points:COLUMNSxROWS:MM` – inner corners of a checkerboard or ChArUco board, numbered row by
/// row. `charuco:COLUMNSxROWS:SQUARE_MM:MARKER_MM[:white]` – the markers of a ChArUco board,
/// counted in squares; numbered from the upper left. `white`: the upper left square is white
/// (OpenCV before 4.7, boards with an even number of rows). `grid:COLUMNSxROWS:TAG_MM:GAP_MM` –
/// tags in rows, numbered from the upper left (ArUco GridBoard).
/// `aprilgrid:COLUMNSxROWS:TAG_MM:SPACING` – Kalibr's, numbered from the lower left; gaps of
/// SPACING × TAG_MM.
/// @return Error with the expected format
[[nodiscard]] Expected<BoardDescription> read_board_description(const std::string& text);
/// The same, or a file: Kalibr's target.yaml (`target_type`: aprilgrid, checkerboard), Basalt's
/// aprilgrid JSON. Lengths are metres there, `tagSpacing` is the gap relative to `tagSize`.
[[nodiscard]] Expected<BoardDescription> read_board(const std::string& text);

/// The part of a file of corners that is used.
struct CornerFileChoice {
  std::string path;
  int width{};
  int height{};
  int camera{0};    ///< Of the column `camera`; without such a column all rows are of one camera.
  std::string set;  ///< Of the column `set`; empty: the file has one or no such column.
  BoardDescription board;
};

/// Corners that another program found. CSV with a line of column names, in any order; further
/// columns are ignored:
///
///     image,tag,corner,u,v      corner 0 … 3: bottom left, bottom right, top right, top left
///     image,tag,blx,bly,brx,bry,trx,try,tlx,tly
///     image,point,u,v           point of a board, row by row
///
/// and `camera`, `set` where a file holds several. Pixels: (0, 0) is the centre of the upper-left
/// one. Also known as: `frame`, `sync_index` (image), `id` (tag), `keypoint_id` (point), `cam`,
/// `cam_id` (camera), `img_loc_x`, `img_loc_y` (u, v). Rows that cannot be used are counted and
/// logged.
/// @return Error when nothing is left, or when the order of the corners shows mirrored images
[[nodiscard]] Expected<CalibrationData> read_corner_file(const CornerFileChoice& choice);

/// What a run of `fiducap calibrate camera` reports.
struct CameraOutcome {
  std::size_t images{};
  std::size_t with_target{};
  IntrinsicsCalibration calibration;
  ImageMap map;
  IntrinsicsVerdict verdict;
};

/// For scripts.
[[nodiscard]] nlohmann::ordered_json to_camera_json(const CameraOutcome& outcome);
/// For people.
void print_camera_report(const Terminal& terminal, const CameraOutcome& outcome,
                         const std::string& input);

/// EuRoC's sensor.yaml without a place on a body, as read_camera_calibration reads it, with sigmas.
[[nodiscard]] std::string to_camera_yaml(const IntrinsicsCalibration& calibration,
                                         const IntrinsicsVerdict& verdict);

/// Three views of the image: where corners were (with rings of equal angle off the axis), how far
/// they are from where the lens projects them, and how well directions are known; above them the
/// verdict with its advice.
[[nodiscard]] PlotPage camera_plots(const CameraOutcome& outcome);

}  // namespace fiducap
