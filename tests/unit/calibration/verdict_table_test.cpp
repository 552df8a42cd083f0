// Right and wrong calibrations, each with its expected verdict and advice. Prints the table of
// docs/design/intrinsics.md.
#include <cmath>
#include <functional>
#include <iostream>
#include <random>
#include <string>

#include <gmock/gmock.h>

#include "base/text.hpp"
#include "calibration/intrinsics/intrinsics_calibration.hpp"
#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "calibration_scene.hpp"

namespace fiducap {
namespace {

/// A calibration, right or wrong. The calibration uses the plain board; the board in front of the
/// camera may differ.
struct VerdictInput {
  CameraModel camera{narrow_lens()};
  bool tags{false};  ///< Six tags at unknown places; else a checkerboard of 9 x 6 corners.
  double square_m{0.035};
  int views{110};  ///< Tried; the whole board must be in view.
  double noise_px{0.1};
  double reach{0.95};  ///< See CalibrationScene::look.
  double tilt_rad{0.8};
  std::uint64_t seed{1};
  /// Where a point of a target really is.
  std::function<Eigen::Vector3d(int target, const Eigen::Vector3d&)> print;
  std::function<double(int view)> zoom;  ///< Focal length, times that of the camera.
  double shutter_s{0};                   ///< Rolling, first row to last, …
  double hand_m_s{0};                    ///< … while the board moves to any side, …
  double hand_rad_s{0};                  ///< … and turns.
};

class VerdictStage final {
 public:
  explicit VerdictStage(const VerdictInput& input)
      : input_(input), scene_(input.camera, input.seed), random_(1000 + input.seed) {
    if (input.tags)
      scene_.add_tags(3, 2);
    else
      scene_.add_checkerboard(9, 6, input.square_m);
  }

  CalibrationData record() {
    for (int i = 0; i < input_.views; ++i) look(i);
    return scene_.data;
  }

 private:
  Eigen::Vector3d any() {
    std::normal_distribution<double> normal(0, 1);
    Eigen::Vector3d out;
    for (int i = 0; i < 3; ++i) out(i) = normal(random_);
    return out;
  }

  void look(int i) {
    CameraModel camera = input_.camera;
    if (input_.zoom) {
      camera.fu *= input_.zoom(i);
      camera.fv *= input_.zoom(i);
    }
    const Pose X_VB = scene_.board_pose(input_.reach, input_.tilt_rad);
    const Eigen::Vector3d v_B = input_.hand_m_s * any();
    const Eigen::Vector3d w_B = input_.hand_rad_s * any();
    CalibrationView view{"image " + std::to_string(i), {}};
    for (std::size_t t = 0; t < scene_.data.targets.size(); ++t)
      see(camera, X_VB, v_B, w_B, static_cast<int>(t), view);
    if (!view.sightings.empty()) scene_.data.views.push_back(std::move(view));
  }

  void see(const CameraModel& camera, const Pose& X_VB, const Eigen::Vector3d& v_V,
           const Eigen::Vector3d& w_B, int t, CalibrationView& view) {
    TargetSighting sighting;
    sighting.target = t;
    const auto& points = scene_.data.targets[static_cast<std::size_t>(t)].points;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d p_T = input_.print ? input_.print(t, points[i]) : points[i];
      const auto px = expose(camera, X_VB, v_V, w_B, scene_.place_of(t) * p_T);
      if (!px || px->x() < 2 || px->y() < 2 || px->x() > camera.width - 3 ||
          px->y() > camera.height - 3)
        return;
      const Eigen::Vector2d seen = *px + input_.noise_px * any().head<2>();
      sighting.points.push_back({static_cast<int>(i), seen, seen});
    }
    view.sightings.push_back(std::move(sighting));
  }

  /// Each row a little later than the one above.
  [[nodiscard]] std::optional<Eigen::Vector2d> expose(const CameraModel& camera, const Pose& X_VB,
                                                      const Eigen::Vector3d& v_V,
                                                      const Eigen::Vector3d& w_B,
                                                      const Eigen::Vector3d& p_B) const {
    auto px = camera.project(X_VB * p_B);
    constexpr int kRounds = 4;
    for (int i = 0; i < kRounds && px && input_.shutter_s > 0; ++i) {
      const double t_s = input_.shutter_s * (px->y() / camera.height - 0.5);
      px = camera.project(X_VB * (exp_so3(w_B * t_s) * p_B) + v_V * t_s);
    }
    return px;
  }

  VerdictInput input_;
  CalibrationScene scene_;
  std::mt19937_64 random_;
};

struct Row {
  std::string name;
  VerdictInput input;
  IntrinsicsGrade grade{IntrinsicsGrade::kGood};
  std::string why{};  ///< Part of one sentence of advice; empty: none.
};

CameraModel bare_lens() { return {752, 480, 458, 458, 375.5, 239.5, Distortion::kNone, {}}; }

CameraModel stretched_lens() {
  CameraModel camera = narrow_lens();
  camera.fu = camera.fv * 3 / 4;
  return camera;
}

CameraModel cut_out_lens() {
  CameraModel camera = narrow_lens();
  camera.cu -= 110;
  return camera;
}

/// A board bent about its y axis by this much of its longer side, middle against edge.
auto bent(double share) {
  return [share](int, const Eigen::Vector3d& p) {
    constexpr double kHalf = 4 * 0.035;
    const double along = p.x() / kHalf;
    return Eigen::Vector3d(p.x(), p.y(), 2 * kHalf * share * along * along);
  };
}

auto stretched(double share) {
  return [share](int, const Eigen::Vector3d& p) {
    return Eigen::Vector3d(p.x() * (1 + share), p.y(), p.z());
  };
}

Eigen::Vector3d one_larger(int target, const Eigen::Vector3d& p) {
  return target == 4 ? Eigen::Vector3d(1.2 * p) : p;
}

Eigen::Vector3d another_board(int, const Eigen::Vector3d& p) {
  return {p.x() + 0.012 * std::sin(90 * p.y()), p.y(), 0};  // rows shifted against each other
}

using enum IntrinsicsGrade;

const std::vector<Row> kRows{
    {"pinhole, checkerboard", {.camera = bare_lens(), .views = 220}},
    {"radial-tangential, checkerboard", {.views = 220}},
    {"radial-tangential, six tags", {.tags = true}},
    {"fisheye, checkerboard", {.camera = fisheye_lens()}},
    {"fisheye, six tags", {.camera = fisheye_lens(), .tags = true}},
    {"few views", {.views = 14}, kWeak, "different images"},
    {"facing the camera, never tilted",
     {.square_m = 0.02, .reach = 0.9, .tilt_rad = 0},
     kWeak,
     "more corners there"},
    {"in the middle, never tilted",
     {.square_m = 0.02, .reach = 0.02, .tilt_rad = 0.02},
     kUseless,
     "parallel to the image"},
    {"small board in the middle",
     {.square_m = 0.01, .reach = 0.1},
     kUseless,
     "of the image was seen"},
    {"small board, half way out", {.square_m = 0.015, .reach = 0.5}, kWeak, "move the target"},
    {"board bent by 0.1 %", {.views = 220, .print = bent(0.001)}},
    {"board bent by 0.6 %", {.print = bent(0.006)}, kWeak, "is bent by about"},
    {"board bent by 4 %", {.print = bent(0.04)}, kUseless, "is bent by about"},
    {"print 1 % wider than high", {.print = stretched(0.01)}, kWeak, "sides x to y"},
    {"print 5 % wider", {.print = stretched(0.05)}, kUseless, "sides x to y"},
    {"one tag of six 20 % larger", {.tags = true, .print = one_larger}, kWeak, "tag 4"},
    {"another board than described", {.print = another_board}, kUseless, "px off"},
    {"autofocus: 4 % longer from the middle on",
     {.zoom = [](int view) { return view < 55 ? 1.0 : 1.04; }},
     kUseless,
     "switch autofocus off"},
    {"autofocus: up to ±3 %, any time",
     {.zoom = [](int view) { return 1 + 0.03 * std::sin(2.4 * view); }},
     kWeak,
     "disagree about the focal length"},
    {"rolling shutter 20 ms, still hand",
     {.views = 220, .shutter_s = 0.02, .hand_m_s = 0.01, .hand_rad_s = 0.02}},
    {"rolling shutter 30 ms, moving hand",
     {.shutter_s = 0.03, .hand_m_s = 0.3, .hand_rad_s = 0.5},
     kWeak,
     "rolling shutter"},
    {"blurred: corners 1.5 px off", {.noise_px = 1.5}, kWeak, "move slowly"},
    {"video mode that stretches 3 to 4", {.camera = stretched_lens()}, kWeak, "not square"},
    {"image cut out of a larger one", {.camera = cut_out_lens()}, kWeak, "off its middle"},
    {"noise instead of corners", {.noise_px = 60}, kUseless, "no camera explains"}};

std::string word(IntrinsicsGrade grade) {
  return grade == kGood ? "good" : grade == kWeak ? "weak" : "refused";
}

void print_row(const Row& row, const IntrinsicsCalibration& c, const IntrinsicsVerdict& v) {
  const CameraModel& truth = row.input.camera;
  const CameraModel& found = c.state.camera;
  std::cout << "| " << row.name << " | " << fixed(truth.fu, 1) << ", " << fixed(truth.fv, 1)
            << " | " << fixed(found.fu, 1) << " ± " << fixed(v.focal_sigma * found.fu, 1) << ", "
            << fixed(found.fv, 1) << " | " << fixed(v.reprojection_rms_px, 2) << " | "
            << word(v.grade) << " | " << (v.advice.empty() ? "" : v.advice.front()) << " |\n";
}

class Verdicts : public ::testing::TestWithParam<Row> {};

std::string test_name(const ::testing::TestParamInfo<Row>& info) {
  std::string name;
  for (const char c : info.param.name)
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Table, Verdicts, ::testing::ValuesIn(kRows), test_name);

TEST_P(Verdicts, MatchTheInput) {
  const Row& row = GetParam();
  const CalibrationData data = VerdictStage(row.input).record();
  const auto result = calibrate_intrinsics(data, {}, [](const std::string&) {});
  if (!result) {
    std::cout << "| " << row.name << " | | | | error | " << result.error().text() << " |\n";
    EXPECT_EQ(row.grade, kUseless) << result.error().text();
    EXPECT_THAT(result.error().text(), ::testing::HasSubstr(row.why));
    return;
  }
  const IntrinsicsVerdict verdict = assess(*result, make_image_map(*result));
  print_row(row, *result, verdict);
  std::string all;
  for (const std::string& advice : verdict.advice) all += advice + "\n";
  EXPECT_EQ(verdict.grade, row.grade) << all;
  if (row.why.empty())
    EXPECT_THAT(verdict.advice, ::testing::IsEmpty());
  else
    EXPECT_THAT(all, ::testing::HasSubstr(row.why));
}

}  // namespace
}  // namespace fiducap
