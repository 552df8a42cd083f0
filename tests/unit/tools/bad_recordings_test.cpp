// Recordings with one fault each: `fiducap check` and `replay` report the likely cause.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <tuple>

#include "support/command_run.hpp"
#include "support/temporary_folder.hpp"
#include "unit/tools/csv_rows.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

constexpr const char* kImu = "mav0/imu0/data.csv";
constexpr const char* kCorners = "mav0/tags0/data.csv";

using Rows = std::vector<CsvRow>;
using Change = std::function<void(Rows&)>;

Change stamps(const std::function<std::int64_t(std::int64_t)>& change) {
  return each_row([change](CsvRow& f) { f[0] = std::to_string(change(std::stoll(f[0]))); });
}
/// Multiplies three fields.
Change scaled(std::size_t from, double factor) {
  return each_row([=](CsvRow& f) {
    for (std::size_t i = from; i < from + 3; ++i) f[i] = std::to_string(std::stod(f[i]) * factor);
  });
}
const Change kAccelerometerInG = scaled(4, 1 / 9.80665);

struct Bad {
  const char* name;
  const char* file;
  Change change;  ///< None: the file is removed.
  bool usable;
  const char* finding;
};

std::ostream& operator<<(std::ostream& out, const Bad& bad) { return out << bad.name; }

/// A faultless recording of a simulated robot, and a copy with a fault.
class BadRecordings : public testing::TestWithParam<Bad> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    for (const char* seed : {"1", "5"})
      ASSERT_EQ(run_fiducap({"simulate", "--room", "table", "--seconds", "12", "--seed", seed,
                             "--out", folder_->file(std::string("good") + seed)})
                    .code,
                kExitOk);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  CommandRun replay(const std::string& recording) const {
    return run_fiducap({"replay", recording, "--out", own_.file("out")});
  }
  [[nodiscard]] CommandRun evaluate(const char* tum, const std::string& recording) const {
    return run_fiducap({"evaluate", own_.file(tum), recording});
  }
  std::string copy() const {
    fs::copy(good(), own_.file("copy"), fs::copy_options::recursive);
    return own_.file("copy");
  }
  std::string copy_with(const char* file, const Change& change) const {
    const std::string recording = copy();
    change_csv(recording + "/" + file, change);
    return recording;
  }
  [[nodiscard]] static std::string good() { return folder_->file("good1"); }
  [[nodiscard]] bool has_report() const { return fs::exists(own_.file("out/report.json")); }

  TemporaryFolder own_;
  static std::unique_ptr<TemporaryFolder> folder_;
};

std::unique_ptr<TemporaryFolder> BadRecordings::folder_;

TEST_P(BadRecordings, CheckAndReplayReportTheCause) {
  const Bad& bad = GetParam();
  const std::string recording = bad.change ? copy_with(bad.file, bad.change) : copy();
  if (!bad.change) fs::remove(recording + "/" + bad.file);
  const auto checked = run_fiducap({"check", recording});
  EXPECT_EQ(checked.code, bad.usable ? kExitOk : kExitFailed);
  EXPECT_THAT(checked.out, HasSubstr(bad.usable ? "  warning: " : "  unusable: "));
  EXPECT_THAT(checked.out, HasSubstr(bad.finding));
  const auto replayed = replay(recording);
  EXPECT_TRUE(bad.usable || replayed.code == kExitFailed);
  EXPECT_THAT(replayed.err, HasSubstr(bad.finding));
  EXPECT_EQ(has_report(), bad.usable);
}

INSTANTIATE_TEST_SUITE_P(
    All, BadRecordings,
    testing::Values(
        Bad{"ImuEmpty", kImu, [](Rows& rows) { rows.clear(); }, false, "has no reading"},
        Bad{"ImuMissing", kImu, nullptr, false, "data.csv is missing"},
        Bad{"ImuInFractionsOfSeconds", kImu,
            each_row([](CsvRow& f) { f[0] = f[0].substr(0, 10) + "." + f[0].substr(10, 6); }),
            false,
            "stamps seem to be seconds; whole nanoseconds are expected, not '1600000000.000000'"},
        Bad{"ImuInMicroseconds", kImu, stamps([](auto ns) { return ns / 1000; }), false,
            "stamps seem to be microseconds"},
        Bad{"ImuOnAnotherClock", kImu,
            stamps([](auto ns) { return ns - 1'599'999'000'000'000'000; }), false,
            "IMU and images have no instant in common"},
        Bad{"ImuThreeSecondsLate", kImu, stamps([](auto ns) { return ns + 3'000'000'000; }), true,
            "begins 3.0 s after the images, and is too long by as much at the other end: its "
            "clock"},
        Bad{"ImuEndsHalfWay", kImu, [](Rows& rows) { rows.resize(rows.size() / 2); }, true,
            "ends 6.0 s before the images"},
        Bad{"GyroInDegrees", kImu, scaled(1, 57.29578), false,
            "the gyro seems to be in degrees per second"},
        Bad{"AccelerometerInG", kImu, kAccelerometerInG, false,
            "the accelerometer seems to be in g"},
        Bad{"CornersOfMirroredImages", kCorners, each_row([](CsvRow& f) {
              for (std::size_t i = 3; i < 11; i += 2) f[i] = std::to_string(751 - std::stod(f[i]));
            }),
            false, "sightings run clockwise"},
        Bad{"CornersBackwards", kCorners,
            [](Rows& rows) { std::reverse(rows.begin(), rows.end()); }, false,
            "time goes back in most of its lines"}),
    [](const auto& param) { return param.param.name; });

class ReplayVerdict : public BadRecordings {};

TEST_F(ReplayVerdict, PosesThatContradictTheTagsAreAFailure) {
  // A shift that breaks the poses and is too small to be seen in the stamps.
  const std::string recording = copy_with(kImu, stamps([](auto ns) { return ns + 900'000'000; }));
  EXPECT_EQ(run_fiducap({"check", recording}).code, kExitOk);
  const auto replayed = replay(recording);
  EXPECT_EQ(replayed.code, kExitFailed);
  EXPECT_THAT(replayed.err, HasSubstr("most sightings of tags contradict the rest"));
}

TEST_F(ReplayVerdict, WrongStampCostsNoPose) {
  const auto placed = [](const CommandRun& run) {
    const auto from = run.out.find("240 frames");
    return run.out.substr(from, run.out.find(" with a pose") - from);
  };
  const auto expected = replay(good());
  ASSERT_EQ(expected.code, kExitOk);
  for (const auto& [file, line, stamp] :
       {std::tuple(kCorners, 200u, "5"), std::tuple(kImu, 0u, "3900000000000000000"),
        std::tuple(kImu, 700u, "0")}) {
    SCOPED_TRACE(stamp);
    const std::string recording =
        copy_with(file, [line = line, stamp = stamp](Rows& rows) { rows[line][0] = stamp; });
    const auto replayed = replay(recording);
    EXPECT_EQ(replayed.code, kExitOk) << replayed.err;
    EXPECT_EQ(placed(replayed), placed(expected));
    fs::remove_all(recording);
  }
}

TEST_F(ReplayVerdict, UnusableRecordingRunsOnRequest) {
  const auto replayed = run_fiducap(
      {"replay", copy_with(kImu, kAccelerometerInG), "--anyway", "--out", own_.file("out")});
  EXPECT_THAT(replayed.err, HasSubstr("warning: "));
  EXPECT_TRUE(has_report());
}

TEST_F(ReplayVerdict, EvaluationNeedsTheSameRecording) {
  ASSERT_EQ(replay(good()).code, kExitOk);
  EXPECT_EQ(evaluate("out/good1.tum", good()).code, kExitOk);
  EXPECT_THAT(evaluate("out/good1.tum", folder_->file("good5")).err,
              HasSubstr("it is the run of another recording, or it has failed"));
  const std::string recording = copy();
  const std::string truth = "/mav0/state_groundtruth_estimate0/data.csv";
  fs::copy_file(folder_->file("good5") + truth, recording + truth,
                fs::copy_options::overwrite_existing);
  ASSERT_EQ(replay(recording).code, kExitOk);
  EXPECT_THAT(evaluate("out/copy.tum", recording).err,
              HasSubstr("the truth is that of another recording"));
}

TEST_F(ReplayVerdict, CalibrationRefusesUnusableRecordings) {
  const std::string recording = copy_with(kImu, kAccelerometerInG);
  for (const char* what : {"imu", "extrinsics"}) {
    const auto run = run_fiducap({"calibrate", what, recording, "--out", own_.file("out")});
    EXPECT_EQ(run.code, kExitFailed);
    EXPECT_THAT(run.err, HasSubstr("the accelerometer seems to be in g")) << what;
  }
}

}  // namespace
}  // namespace fiducap
