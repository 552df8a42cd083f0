#include "tools/replay/run_files.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/evaluation.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

// Metres and radians: numbers are written so that they read back.
constexpr double kRounding = 1e-12;

OfflineResult result() {
  OfflineResult r;
  r.trajectory = {{instant_from_ns(1'000'000'001), {exp_so3({0.1, 0.2, 0.3}), {1, 2, 3}}}};
  r.known = {{3, 0.2, {exp_so3({1, 0, 0}), {5, 5, 1. / 3}}, Matrix6d::Zero()}};
  TagBelief belief;
  belief.tag = {1, 0.16, {exp_so3({0, 1, 0}), {0.1, 0.7, 1. / 7}}, Matrix6d::Identity() * 1e-6};
  r.tags = {belief};
  r.extrinsics = {{{exp_so3({0.3, 0.1, -0.7}), {0.01, 0.02, 1. / 3}}, Matrix6d::Zero()}};
  r.statistics.frames = 40;
  r.statistics.frames_with_pose = 39;
  r.statistics.data_s = 2;
  r.statistics.propagate_cpu_s = 0.25;
  r.statistics.update_cpu_s = 0.75;
  r.statistics.nis_sum = 90;
  r.statistics.nis_dof = 100;
  return r;
}

class RunFiles : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<RunBody> bodies() const { return {{name_, "", &setup_, &result_}}; }
  void write(const std::string& folder = "out") const {
    value_of(write_run_files(folder_.file(folder), bodies(), session_));
  }
  [[nodiscard]] nlohmann::json report() const {
    return nlohmann::json::parse(run_report(bodies(), session_));
  }
  [[nodiscard]] Expected<RunResults> read(const std::string& name = "out/table.tum") const {
    return read_run(folder_.file(name), 1);
  }

  TemporaryFolder folder_;
  OfflineSetup setup_;
  OfflineResult result_{result()};
  OfflineSession session_;
  std::string name_{"table"};
};

TEST_F(RunFiles, RoundTripGivesTheSameRun) {
  write();
  const auto run = value_of(read());
  ASSERT_EQ(run.trajectory.size(), 1u);
  EXPECT_EQ(run.trajectory[0].at, result_.trajectory[0].at);
  ASSERT_EQ(run.map.size(), 2u);
  EXPECT_EQ(run.map[0].tag_id, 1);
  EXPECT_LT((run.map[0].X_WT.p - result_.tags[0].tag.X_WT.p).norm(), kRounding);
  EXPECT_LT(angle_between(run.map[1].X_WT.q, result_.known[0].X_WT.q), kRounding);
  EXPECT_EQ(run.map[1].edge_m, 0.2);
  EXPECT_LT((run.X_BV[0].p - result_.extrinsics[0].X_BV.p).norm(), kRounding);
  EXPECT_LT(angle_between(run.X_BV[0].q, result_.extrinsics[0].X_BV.q), kRounding);
}

TEST_F(RunFiles, PartsOutsideOfTheWorkspaceHaveFilesOfTheirOwn) {
  for (int k = 0; k < 2; ++k) {
    OfflinePart part;
    part.trajectory = {
        {instant_from_ns(2'000'000'000 + k), {exp_so3({0, 0, 0.1}), {k + 1., 0, 0}}}};
    part.tags = {{70 + k, 0.2, {exp_so3({1, 0, 0}), {0, 0, 1. / 3}}, Matrix6d::Zero()}};
    result_.parts.push_back(part);
  }
  write();
  const auto run = value_of(read());
  ASSERT_EQ(run.map.size(), 2u) << "their tags are not in the map";
  ASSERT_EQ(run.parts.size(), 2u);
  EXPECT_EQ(run.parts[1].trajectory.at(0).at, result_.parts[1].trajectory[0].at);
  EXPECT_LT((run.parts[1].trajectory[0].X_WB.p - Eigen::Vector3d(2, 0, 0)).norm(), kRounding);
  EXPECT_EQ(run.parts[1].map.at(0).tag_id, 71);
  EXPECT_EQ(report()["parts"][1]["file"], "table.2.part.tum");
  EXPECT_EQ(report()["parts"][1]["tags"][0], 71);
  result_.parts.clear();
  write();
  EXPECT_TRUE(value_of(read()).parts.empty()) << "an earlier run is replaced completely";
}

TEST_F(RunFiles, ReportHasNumbersAndEvents) {
  BodyEvent relocalised;
  relocalised.kind = BodyEvent::Kind::kRelocalised;
  BodyEvent mismatch;
  mismatch.kind = BodyEvent::Kind::kMismatch;
  mismatch.at = instant_from_ns(5);
  mismatch.text = "all tags seem larger";
  result_.events = {relocalised, relocalised, mismatch};
  const auto json = report();
  EXPECT_EQ(json["frames"], 40);
  EXPECT_EQ(json["frames_with_pose"], 39);
  EXPECT_EQ(json["tags_mapped"], 1);
  EXPECT_DOUBLE_EQ(json["cpu_s"]["filter_per_second_of_data"], 0.5);
  EXPECT_DOUBLE_EQ(json["filter_statistics"]["nis_per_dof"], 0.9);
  EXPECT_EQ(json["events"]["relocalised"], 2);
  EXPECT_EQ(json["events"]["reset"], 0);
  ASSERT_EQ(json["said"].size(), 1u);
  EXPECT_EQ(json["said"][0]["event"], "mismatch");
  EXPECT_EQ(json["said"][0]["t_ns"], 5);
  EXPECT_EQ(json["said"][0]["text"], mismatch.text);
}

TEST_F(RunFiles, MapListsATagInTheStateAndKnownOnce) {
  result_.tags[0].tag.tag_id = 3;
  const TagMap map = run_map(bodies());
  ASSERT_EQ(map.tags.size(), 1u);
  EXPECT_EQ(map.tags[0].state, TagState::kSurveyed);
}

TEST_F(RunFiles, ReplaceAnEarlierRun) {
  name_ = "hall";
  ASSERT_TRUE(check_run_folder(folder_.file("out")));
  write();
  ASSERT_TRUE(check_run_folder(folder_.file("out")));
  name_ = "table";
  write();
  EXPECT_FALSE(std::filesystem::exists(folder_.file("out/hall.tum")));
  EXPECT_TRUE(read());
}

TEST_F(RunFiles, RefuseForeignFiles) {
  write();
  folder_.write("out/hall.tum", "1.0 0 0 0 0 0 0 1\n");
  EXPECT_THAT(error_of(read("out/hall.tum")), HasSubstr("another run"));
  folder_.write("other/map.csv", "id,size\n");
  EXPECT_THAT(error_of(check_run_folder(folder_.file("other"))), HasSubstr("map.csv"));
  folder_.write("plots/plots.html", "<html/>");
  EXPECT_FALSE(check_run_folder(folder_.file("plots"))) << "it may be of another run";
}

TEST_F(RunFiles, HaveCovariancesAndEvents) {
  result_.covariances = {{result_.trajectory[0].at, Matrix6d::Identity() * 0.25}};
  result_.events = {{BodyEvent::Kind::kReset, instant_from_ns(5), -1, {}, {}}};
  session_.map_events = {
      {instant_from_ns(3), {MapEvent::Kind::kTagAdded, 4, "tag 4 joined the map, seen by body 1"}}};
  write();
  EXPECT_THAT(content_of(folder_.file("out/table.covariance.csv")),
              HasSubstr("\n1000000001,0.25,0,0,0,0,0,0.25,"));
  EXPECT_THAT(content_of(folder_.file("out/events.csv")),
              HasSubstr("\n3,,tag_added,4,0,0,tag 4 joined the map; seen by body 1\n"
                        "5,table,reset,,0,0,\n"));
}

TEST_F(RunFiles, ErrorNamesTheMissingFile) {
  write("");
  for (const char* missing : {"extrinsics.yaml", "map.csv"}) {
    std::filesystem::remove(folder_.file(missing));
    EXPECT_THAT(read("table.tum").error().context, HasSubstr(missing));
  }
}

TEST(Extrinsics, AreRefusedUnlessRigid) {
  const auto read = [](const std::string& text) { return extrinsics_from_yaml(text, 1, "e.yaml"); };
  EXPECT_TRUE(read("cam0:\n  T_BS:\n    data: [1,0,0,1, 0,1,0,2, 0,0,1,3, 0,0,0,1]\n"));
  for (const char* bad :
       {"", "cam0: 3", "cam1:\n  T_BS: {data: [1]}", "cam0: {T_BS: {data: [1, 2]}}",
        "cam0: {T_BS: [1]}", "cam0: {T_BS: {data: [x,0,0,1, 0,1,0,2, 0,0,1,3, 0,0,0,1]}}", "{",
        "[1, 2]", "cam0: {T_BS: {data: [2,0,0,1, 0,1,0,2, 0,0,1,3, 0,0,0,1]}}",
        "cam0: {T_BS: {data: [.nan,0,0,1, 0,1,0,2, 0,0,1,3, 0,0,0,1]}}",
        "cam0: {T_BS: {data: [-1,0,0,1, 0,1,0,2, 0,0,1,3, 0,0,0,1]}}"})
    EXPECT_FALSE(read(bad)) << bad;
}

// (2, 4, 5, 6)/9 is a unit quaternion with four different parts: no swapped order can pass. Eigen
// takes w x y z.
const Pose kPose{{2 / 9., 4 / 9., 5 / 9., 6 / 9.}, {1.5, -2.25, 0.125}};

TEST(TumFile, RoundTripIsExact) {
  const std::vector<StampedPose> poses{{instant_from_ns(1'600'000'000'000'000'001), kPose},
                                       {instant_from_ns(1'600'000'000'999'999'999), kPose}};
  const std::string text = to_tum(poses);
  EXPECT_THAT(text,
              testing::StartsWith("1600000000.000000001 1.5 -2.25 0.125 0.4444444444444444 "
                                  "0.5555555555555556 0.6666666666666666 0.2222222222222222\n"));
  const auto read = value_of(tum_from(text, "test"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].at, poses[0].at);
  EXPECT_EQ(read[1].at, poses[1].at);
  EXPECT_EQ(read[0].X_WB.p, kPose.p);
  EXPECT_LT(read[0].X_WB.q.angularDistance(kPose.q), 1e-15);
}

TEST(TumFile, ReadsFilesOfOtherPrograms) {
  const auto read =
      value_of(tum_from("# comment\n\n 12.5\t1 2 3  0 0 0 1\r\n13 1 2 3 0 0 0 -1", "test"));
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(to_ns(read[0].at), 12'500'000'000);
  EXPECT_EQ(to_ns(read[1].at), 13'000'000'000);
}

TEST(TumFile, ReportsTheLineThatIsNoPose) {
  for (const char* bad :
       {"1 2 3", "1 0 0 0 0 0 0 2", "x 0 0 0 0 0 0 1", "1 0 0 nan 0 0 0 1", "1 0 0 0 0 0 0 1 9",
        "-1 0 0 0 0 0 0 1", "1.5x 0 0 0 0 0 0 1", "99999999999 0 0 0 0 0 0 1"}) {
    const auto read = tum_from(std::string("0 0 0 0 0 0 0 1\n") + bad + "\n", "file.tum");
    ASSERT_FALSE(read) << bad;
    EXPECT_EQ(read.error().context, "file.tum:2") << bad;
  }
  EXPECT_FALSE(tum_from("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "test")) << "time does not increase";
}

std::string line_of(const std::string& stamp, const std::string& last = "1e-6") {
  return stamp + ",1e-6,0,0,0,0,0,1e-6,0,0,0,0,1e-6,0,0,0,1e-6,0,0,1e-6,0," + last + "\n";
}

TEST(CovarianceFile, RoundTripIsExact) {
  StampedCovariance one{instant_from_ns(1'600'000'000'123'456'789), Matrix6d::Zero()};
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      one.covariance(row, column) = one.covariance(column, row) =
          (row == column ? 1. : -0.1) / (3 + row + 7 * column);
  const std::vector<StampedCovariance> written{one, {one.at + Duration{1}, one.covariance / 3}};
  const auto read = value_of(covariances_from_csv(to_covariance_csv(written), "c.csv"));
  ASSERT_EQ(read.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read[i].at, written[i].at);
    EXPECT_EQ(read[i].covariance, written[i].covariance);
  }
}

TEST(CovarianceFile, SkipsCommentsAndEmptyLines) {
  EXPECT_EQ(value_of(covariances_from_csv("#t_ns,P00\n\n" + line_of("5"), "c.csv")).size(), 1u);
  EXPECT_TRUE(covariances_from_csv("", "c.csv"));
}

TEST(CovarianceFile, ReportsTheLineThatIsNoCovariance) {
  for (const std::string& bad :
       {line_of("x"), line_of("5.5"), line_of("5", "nan"), line_of("5", "-1e-6"),
        line_of("5", "1e-6,0"), line_of("5", ""), std::string("5,1,2\n"), line_of("4"),
        line_of("99999999999999999999")})
    EXPECT_THAT(error_of(covariances_from_csv(line_of("4") + bad, "c.csv")), HasSubstr("c.csv:2"))
        << bad;
}

}  // namespace
}  // namespace fiducap
