// Right and wrong calibrations, each with its expected verdict and advice. Prints the table of
// docs/design/intrinsics.md.
#include <cmath>
#include <iostream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.hpp"
#include "calibration/intrinsics/intrinsics_calibration.hpp"
#include "calibration/intrinsics/intrinsics_verdict.hpp"
#include "verdict_inputs.hpp"

namespace fiducap {
namespace {

struct Row {
  std::string name;
  VerdictInput input;
  IntrinsicsGrade grade{IntrinsicsGrade::kGood};
  std::string why;  ///< Part of one sentence of advice; empty: none.
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

std::vector<Row> good_rows() {
  std::vector<Row> rows;
  rows.push_back(
      {"pinhole, checkerboard", {.camera = bare_lens(), .views = 220}, IntrinsicsGrade::kGood, ""});
  rows.push_back({"radial-tangential, checkerboard", {.views = 220}, IntrinsicsGrade::kGood, ""});
  rows.push_back({"radial-tangential, six tags", {.tags = true}, IntrinsicsGrade::kGood, ""});
  rows.push_back({"fisheye, checkerboard", {.camera = fisheye_lens()}, IntrinsicsGrade::kGood, ""});
  rows.push_back(
      {"fisheye, six tags", {.camera = fisheye_lens(), .tags = true}, IntrinsicsGrade::kGood, ""});
  return rows;
}

std::vector<Row> rows_with_wrong_views() {
  using G = IntrinsicsGrade;
  std::vector<Row> rows;
  rows.push_back({"few views", {.views = 14}, G::kWeak, "different images"});
  rows.push_back({"facing the camera, never tilted",
                  {.square_m = 0.02, .reach = 0.9, .tilt_rad = 0},
                  G::kWeak,
                  "more corners there"});
  rows.push_back({"in the middle, never tilted",
                  {.square_m = 0.02, .reach = 0.02, .tilt_rad = 0.02},
                  G::kUseless,
                  "parallel to the image"});
  rows.push_back({"small board in the middle",
                  {.square_m = 0.01, .reach = 0.1},
                  G::kUseless,
                  "of the image was seen"});
  rows.push_back({"small board, half way out",
                  {.square_m = 0.015, .reach = 0.5},
                  G::kWeak,
                  "move the target"});
  return rows;
}

std::vector<Row> rows_with_wrong_targets() {
  using G = IntrinsicsGrade;
  std::vector<Row> rows;
  rows.push_back({"board bent by 0.1 %", {.views = 220, .print = bent(0.001)}, G::kGood, ""});
  rows.push_back({"board bent by 0.6 %", {.print = bent(0.006)}, G::kWeak, "is bent by about"});
  rows.push_back({"board bent by 4 %", {.print = bent(0.04)}, G::kUseless, "is bent by about"});
  rows.push_back(
      {"print 1 % wider than high", {.print = stretched(0.01)}, G::kWeak, "sides x to y"});
  rows.push_back({"print 5 % wider", {.print = stretched(0.05)}, G::kUseless, "sides x to y"});
  rows.push_back(
      {"one tag of six 20 % larger", {.tags = true, .print = one_larger}, G::kWeak, "tag 4"});
  rows.push_back({"another board than described", {.print = another_board}, G::kUseless, "px off"});
  return rows;
}

std::vector<Row> rows_with_wrong_cameras() {
  using G = IntrinsicsGrade;
  std::vector<Row> rows;
  rows.push_back({"autofocus: 4 % longer from the middle on",
                  {.zoom = [](int view) { return view < 55 ? 1.0 : 1.04; }},
                  G::kUseless,
                  "switch autofocus off"});
  rows.push_back({"autofocus: up to ±3 %, any time",
                  {.zoom = [](int view) { return 1 + 0.03 * std::sin(2.4 * view); }},
                  G::kWeak,
                  "disagree about the focal length"});
  rows.push_back({"rolling shutter 20 ms, still hand",
                  {.views = 220, .shutter_s = 0.02, .hand_m_s = 0.01, .hand_rad_s = 0.02},
                  G::kGood,
                  ""});
  rows.push_back({"rolling shutter 30 ms, moving hand",
                  {.shutter_s = 0.03, .hand_m_s = 0.3, .hand_rad_s = 0.5},
                  G::kWeak,
                  "rolling shutter"});
  rows.push_back({"blurred: corners 1.5 px off", {.noise_px = 1.5}, G::kWeak, "move slowly"});
  rows.push_back(
      {"video mode that stretches 3 to 4", {.camera = stretched_lens()}, G::kWeak, "not square"});
  rows.push_back(
      {"image cut out of a larger one", {.camera = cut_out_lens()}, G::kWeak, "off its middle"});
  rows.push_back({"noise instead of corners", {.noise_px = 60}, G::kUseless, "no camera explains"});
  return rows;
}

std::string word(IntrinsicsGrade grade) {
  return grade == IntrinsicsGrade::kGood   ? "good"
         : grade == IntrinsicsGrade::kWeak ? "weak"
                                           : "refused";
}

void print_row(const Row& row, const IntrinsicsCalibration& c, const IntrinsicsVerdict& v) {
  const CameraModel& truth = row.input.camera;
  const CameraModel& found = c.state.camera;
  std::cout << "| " << row.name << " | " << fixed(truth.fu, 1) << ", " << fixed(truth.fv, 1)
            << " | " << fixed(found.fu, 1) << " ± " << fixed(v.focal_sigma * found.fu, 1) << ", "
            << fixed(found.fv, 1) << " | " << fixed(v.reprojection_rms_px, 2) << " | "
            << word(v.grade) << " | " << (v.advice.empty() ? "" : v.advice.front()) << " |\n";
  std::cout << "    free " << c.free.size()
            << (found.distortion == Distortion::kEquidistant ? " eq" : " rt") << " covered "
            << v.covered << " tilted " << v.tilted << " p90 " << v.tilt_rad * 57.3 << " fsig "
            << v.focal_sigma << " corr " << c.uncertainty.correlation << " fscat "
            << c.uncertainty.focal_scatter << " cond " << c.uncertainty.condition << " misfit "
            << v.misfit_px << " held " << c.held_out.ratio << " step " << c.held_out.focal_step()
            << " (" << c.held_out.focal_step_sigma() << ") bend " << c.shape.bend << " ± "
            << c.shape.bend_sigma << " stretch " << c.shape.stretch << " ± "
            << c.shape.stretch_sigma << " unc " << v.uncertainty_median_px << " "
            << v.uncertainty_worst_px << " rej " << c.rejected << " folded " << v.shape.folded
            << "\n";
  for (const std::string& advice : v.advice) std::cout << "    - " << advice << "\n";
}

class Verdicts : public ::testing::TestWithParam<Row> {};

std::string test_name(const ::testing::TestParamInfo<Row>& info) {
  std::string name;
  for (const char c : info.param.name)
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Good, Verdicts, ::testing::ValuesIn(good_rows()), test_name);
INSTANTIATE_TEST_SUITE_P(Views, Verdicts, ::testing::ValuesIn(rows_with_wrong_views()), test_name);
INSTANTIATE_TEST_SUITE_P(Targets, Verdicts, ::testing::ValuesIn(rows_with_wrong_targets()),
                         test_name);
INSTANTIATE_TEST_SUITE_P(Cameras, Verdicts, ::testing::ValuesIn(rows_with_wrong_cameras()),
                         test_name);

TEST_P(Verdicts, MatchTheInput) {
  const Row& row = GetParam();
  const CalibrationData data = VerdictStage(row.input).record();
  const auto result = calibrate_intrinsics(data, {}, [](const std::string&) {});
  if (!result) {
    std::cout << "| " << row.name << " | | | | error | " << result.error().text() << " |\n";
    EXPECT_EQ(row.grade, IntrinsicsGrade::kUseless) << result.error().text();
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
