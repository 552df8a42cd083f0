// Recordings that are wrong in one way each: `fiducap check` and `replay` name the likely cause.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <sstream>
#include <tuple>

#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"
#include "tools/command_line.hpp"
#include "tools/terminal.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
namespace fs = std::filesystem;

constexpr const char* kImu = "mav0/imu0/data.csv";
constexpr const char* kCorners = "mav0/tags0/data.csv";

using Fields = std::vector<std::string>;
using Rows = std::vector<Fields>;
using Change = std::function<void(Rows&)>;

Rows rows_of(const std::string& text) {
  Rows rows;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream fields(line);
    rows.emplace_back();
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  return rows;
}

Change each(const std::function<void(Fields&)>& change) {
  return [change](Rows& rows) {
    for (Fields& fields : rows) change(fields);
  };
}

Change stamps(const std::function<std::int64_t(std::int64_t)>& change) {
  return each([change](Fields& f) { f[0] = std::to_string(change(std::stoll(f[0]))); });
}

/// Multiplies three fields.
Change scaled(std::size_t from, double factor) {
  return each([=](Fields& f) {
    for (std::size_t i = from; i < from + 3; ++i) f[i] = std::to_string(std::stod(f[i]) * factor);
  });
}

struct Bad {
  const char* name;
  const char* file;
  Change change;
  bool usable;
  const char* says;
};

std::ostream& operator<<(std::ostream& out, const Bad& bad) { return out << bad.name; }

/// One sound recording of a simulated robot, and a copy that is spoilt.
class BadRecordings : public testing::TestWithParam<Bad> {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    for (const char* seed : {"1", "5"})
      ASSERT_EQ(say({"simulate", "--room", "table", "--seconds", "12", "--seed", seed, "--out",
                     folder_->file(std::string("sound") + seed)}),
                kExitOk);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static int say(std::vector<std::string> words) {
    std::vector<const char*> argv{"fiducap"};
    for (const std::string& word : words) argv.push_back(word.c_str());
    std::ostringstream out;
    std::ostringstream err;
    const int code = run_command_line(static_cast<int>(argv.size()), argv.data(), {out, err});
    out_ = out.str();
    err_ = err.str();
    return code;
  }
  std::string copy() const {
    fs::copy(sound(), own_.file("copy"), fs::copy_options::recursive);
    return own_.file("copy");
  }
  static void spoil(const std::string& file, const Change& change) {
    const auto text = read_whole_file(file);
    ASSERT_TRUE(text) << text.error().text();
    Rows rows = rows_of(*text);
    change(rows);
    std::string changed = text->substr(0, text->find('\n') + 1);
    for (const Fields& fields : rows) {
      for (const std::string& field : fields) changed += (&field == &fields[0] ? "" : ",") + field;
      changed += '\n';
    }
    ASSERT_TRUE(write_whole_file(file, changed));
  }
  [[nodiscard]] static std::string sound() { return folder_->file("sound1"); }

  TemporaryFolder own_;
  static std::unique_ptr<TemporaryFolder> folder_;
  static std::string out_;
  static std::string err_;
};

std::unique_ptr<TemporaryFolder> BadRecordings::folder_;
std::string BadRecordings::out_;
std::string BadRecordings::err_;

TEST_P(BadRecordings, CheckAndReplayNameTheLikelyCause) {
  const Bad& bad = GetParam();
  const std::string recording = copy();
  if (bad.change)
    spoil(recording + "/" + bad.file, bad.change);
  else
    fs::remove(recording + "/" + bad.file);
  EXPECT_EQ(say({"check", recording}), bad.usable ? kExitOk : kExitFailed);
  EXPECT_THAT(out_, HasSubstr(bad.usable ? "  warning: " : "  unusable: "));
  EXPECT_THAT(out_, HasSubstr(bad.says));
  const int replayed = say({"replay", recording, "--out", own_.file("out")});
  EXPECT_TRUE(bad.usable || replayed == kExitFailed);
  EXPECT_THAT(err_, HasSubstr(bad.says));
  EXPECT_EQ(fs::exists(own_.file("out/report.json")), bad.usable) << "nothing is made of nonsense";
}

INSTANTIATE_TEST_SUITE_P(
    All, BadRecordings,
    testing::Values(
        Bad{"ImuEmpty", kImu, [](Rows& rows) { rows.clear(); }, false, "has no reading"},
        Bad{"ImuMissing", kImu, nullptr, false, "data.csv is missing"},
        Bad{"ImuInFractionsOfSeconds", kImu,
            each([](Fields& f) { f[0] = f[0].substr(0, 10) + "." + f[0].substr(10, 6); }), false,
            "stamps seem to be seconds; whole nanoseconds are expected, not '1600000000.000000'"},
        Bad{"ImuInWholeSeconds", kImu, stamps([](auto ns) { return ns / 1'000'000'000; }), false,
            "stamps seem to be seconds"},
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
        Bad{"AccelerometerInG", kImu, scaled(4, 1 / 9.80665), false,
            "the accelerometer seems to be in g"},
        Bad{"CornersOfMirroredImages", kCorners, each([](Fields& f) {
              for (std::size_t i = 3; i < 11; i += 2) f[i] = std::to_string(751 - std::stod(f[i]));
            }),
            false, "sightings run clockwise"},
        Bad{"CornersInAnotherOrder", kCorners, each([](Fields& f) {
              std::swap(f[3], f[9]);
              std::swap(f[4], f[10]);
              std::swap(f[5], f[7]);
              std::swap(f[6], f[8]);
            }),
            false, "sightings run clockwise"},
        Bad{"CornersBackwards", kCorners,
            [](Rows& rows) { std::reverse(rows.begin(), rows.end()); }, false,
            "time goes back in most of its lines"}),
    [](const auto& param) { return param.param.name; });

TEST_F(BadRecordings, PosesThatContradictTheTagsAreNoSuccess) {
  const std::string recording = copy();
  // Enough to spoil, too little for the stamps to show it.
  spoil(recording + "/" + kImu, stamps([](auto ns) { return ns + 900'000'000; }));
  EXPECT_EQ(say({"check", recording}), kExitOk);
  EXPECT_EQ(say({"replay", recording, "--out", own_.file("out")}), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("most sightings of tags contradict the rest"));
}

class SoundRecordings : public BadRecordings {};

TEST_F(SoundRecordings, AreNotObjectedTo) {
  EXPECT_EQ(say({"check", sound()}), kExitOk);
  EXPECT_THAT(out_, HasSubstr("no findings"));
  EXPECT_EQ(say({"replay", sound(), "--out", own_.file("out")}), kExitOk);
  EXPECT_THAT(err_, IsEmpty());
}

TEST_F(SoundRecordings, OneWrongStampCostsNoImageNoPose) {
  ASSERT_EQ(say({"replay", sound(), "--out", own_.file("sound")}), kExitOk);
  const auto placed = [](const std::string& out) {
    return out.substr(out.find("240 frames"), out.find(" with a pose") - out.find("240 frames"));
  };
  const std::string expected = placed(out_);
  for (const auto& [file, line, stamp] :
       {std::tuple(kCorners, 200, "5"), std::tuple(kImu, 0, "3900000000000000000"),
        std::tuple(kImu, 700, "0")}) {
    SCOPED_TRACE(stamp);
    const std::string recording = copy();
    spoil(recording + "/" + file, [line = line, stamp = stamp](Rows& rows) {
      rows[static_cast<std::size_t>(line)][0] = stamp;
    });
    EXPECT_EQ(say({"replay", recording, "--out", own_.file("out")}), kExitOk) << err_;
    EXPECT_EQ(placed(out_), expected);
    fs::remove_all(recording);
  }
}

TEST_F(SoundRecordings, AnUnusableOneRunsWhenToldTo) {
  const std::string recording = copy();
  spoil(recording + "/" + kImu, scaled(4, 1 / 9.80665));
  (void)say({"replay", recording, "--anyway", "--out", own_.file("out")});
  EXPECT_THAT(err_, HasSubstr("warning: "));
  EXPECT_TRUE(fs::exists(own_.file("out/report.json")));
}

TEST_F(SoundRecordings, ARunIsNotHeldAgainstAnotherRecording) {
  ASSERT_EQ(say({"replay", sound(), "--out", own_.file("out")}), kExitOk);
  EXPECT_EQ(say({"evaluate", own_.file("out/sound1.tum"), sound()}), kExitOk) << err_;
  EXPECT_EQ(say({"evaluate", own_.file("out/sound1.tum"), folder_->file("sound5")}), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("it is the run of another recording, or it has failed"));
}

TEST_F(SoundRecordings, TruthOfAnotherRecordingIsNoticed) {
  const std::string recording = copy();
  const std::string truth = "/mav0/state_groundtruth_estimate0/data.csv";
  fs::copy_file(folder_->file("sound5") + truth, recording + truth,
                fs::copy_options::overwrite_existing);
  ASSERT_EQ(say({"replay", recording, "--out", own_.file("out")}), kExitOk);
  EXPECT_EQ(say({"evaluate", own_.file("out/copy.tum"), recording}), kExitFailed);
  EXPECT_THAT(err_, HasSubstr("the truth is that of another recording"));
}

TEST_F(SoundRecordings, CalibrationRefusesWhatIsUnusable) {
  const std::string recording = copy();
  spoil(recording + "/" + kImu, scaled(4, 1 / 9.80665));
  for (const char* what : {"imu", "extrinsics"}) {
    EXPECT_EQ(say({"calibrate", what, recording, "--out", own_.file("out")}), kExitFailed);
    EXPECT_THAT(err_, HasSubstr("the accelerometer seems to be in g")) << what;
  }
}

}  // namespace
}  // namespace fiducap
