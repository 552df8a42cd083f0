#include "tools/replay/run_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/pose.hpp"
#include "base/whole_file.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/evaluation.hpp"

namespace fiducap {
namespace {

using ::testing::HasSubstr;

constexpr double kRounding =
    1e-12;  // metres and radians: numbers are written so that they read back

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

/// A run of one body, as the writer wants it.
struct OneBody {
  explicit OneBody(OfflineResult r) : result(std::move(r)) {}
  OfflineSetup setup;
  OfflineResult result;
  OfflineSession session;
  std::string name{"table"};
  [[nodiscard]] std::vector<RunBody> bodies() const { return {{name, "", &setup, &result}}; }
  [[nodiscard]] Expected<void> write(const std::string& folder) const {
    return write_run_files(folder, bodies(), session);
  }
};

TEST(RunFiles, WhatIsWrittenReadsBackAsTheSameRun) {
  const TemporaryFolder folder;
  const OfflineResult written = result();
  ASSERT_TRUE(OneBody(written).write(folder.file("out")));
  const auto run = read_run(folder.file("out/table.tum"), 1);
  ASSERT_TRUE(run) << run.error().text();
  ASSERT_EQ(run->trajectory.size(), 1u);
  EXPECT_EQ(run->trajectory[0].at, written.trajectory[0].at);
  ASSERT_EQ(run->map.size(), 2u);
  EXPECT_EQ(run->map[0].tag_id, 1);
  EXPECT_LT((run->map[0].X_WT.p - written.tags[0].tag.X_WT.p).norm(), kRounding);
  EXPECT_LT(angle_between(run->map[1].X_WT.q, written.known[0].X_WT.q), kRounding);
  EXPECT_EQ(run->map[1].edge_m, 0.2);
  EXPECT_LT((run->X_BV[0].p - written.extrinsics[0].X_BV.p).norm(), kRounding);
  EXPECT_LT(angle_between(run->X_BV[0].q, written.extrinsics[0].X_BV.q), kRounding);
}

TEST(RunFiles, WhatNothingTiesToTheWorkspaceIsWrittenBesideItAndGoesWithTheRun) {
  const TemporaryFolder folder;
  OfflineResult written = result();
  for (int k = 0; k < 2; ++k) {
    OfflinePart part;
    part.trajectory = {
        {instant_from_ns(2'000'000'000 + k), {exp_so3({0, 0, 0.1}), {k + 1., 0, 0}}}};
    part.tags = {{70 + k, 0.2, {exp_so3({1, 0, 0}), {0, 0, 1. / 3}}, Matrix6d::Zero()}};
    written.parts.push_back(part);
  }
  const OneBody body(written);
  ASSERT_TRUE(body.write(folder.file("out")));
  const auto run = read_run(folder.file("out/table.tum"), 1);
  ASSERT_TRUE(run) << run.error().text();
  ASSERT_EQ(run->map.size(), 2u) << "their tags are not in the map";
  ASSERT_EQ(run->parts.size(), 2u);
  EXPECT_EQ(run->parts[1].trajectory.at(0).at, written.parts[1].trajectory[0].at);
  EXPECT_LT((run->parts[1].trajectory[0].X_WB.p - Eigen::Vector3d(2, 0, 0)).norm(), kRounding);
  EXPECT_EQ(run->parts[1].map.at(0).tag_id, 71);
  const auto report = nlohmann::json::parse(run_report(body.bodies(), body.session));
  EXPECT_EQ(report["parts"][1]["file"], "table.2.part.tum");
  EXPECT_EQ(report["parts"][1]["tags"][0], 71);
  ASSERT_TRUE(OneBody(result()).write(folder.file("out")));
  const auto next = read_run(folder.file("out/table.tum"), 1);
  ASSERT_TRUE(next);
  EXPECT_TRUE(next->parts.empty()) << "an earlier run is replaced whole";
}

TEST(RunFiles, ReportCarriesTheFigures) {
  const OneBody run(result());
  const auto report = nlohmann::json::parse(run_report(run.bodies(), run.session));
  EXPECT_EQ(report["frames"], 40);
  EXPECT_EQ(report["frames_with_pose"], 39);
  EXPECT_EQ(report["tags_mapped"], 1);
  EXPECT_DOUBLE_EQ(report["cpu_s"]["filter_per_second_of_data"], 0.5);
  EXPECT_DOUBLE_EQ(report["filter_statistics"]["nis_per_dof"], 0.9);
}

TEST(RunFiles, ReportSaysWhatHappenedAndWhatWasSaid) {
  OfflineResult r = result();
  BodyEvent found;
  found.kind = BodyEvent::Kind::kRelocalised;
  BodyEvent said;
  said.kind = BodyEvent::Kind::kMismatch;
  said.at = instant_from_ns(5);
  said.text = "all tags seem larger";
  r.events = {found, found, said};
  const OneBody run(r);
  const auto report = nlohmann::json::parse(run_report(run.bodies(), run.session));
  EXPECT_EQ(report["events"]["relocalised"], 2);
  EXPECT_EQ(report["events"]["reset"], 0);
  ASSERT_EQ(report["said"].size(), 1u);
  EXPECT_EQ(report["said"][0]["event"], "mismatch");
  EXPECT_EQ(report["said"][0]["t_ns"], 5);
  EXPECT_EQ(report["said"][0]["text"], said.text);
}

TEST(RunFiles, AKnownTagThatIsAlsoInTheStateIsListedOnce) {
  OfflineResult r = result();
  r.tags[0].tag.tag_id = 3;
  const OneBody run(r);
  const TagMap map = run_map(run.bodies());
  ASSERT_EQ(map.tags.size(), 1u);
  EXPECT_EQ(map.tags[0].state, TagState::kSurveyed);
}

TEST(RunFiles, AnEarlierRunInTheFolderIsReplacedWhole) {
  const TemporaryFolder folder;
  OneBody first(result());
  first.name = "hall";
  ASSERT_TRUE(check_run_folder(folder.file("out")));
  ASSERT_TRUE(first.write(folder.file("out")));
  ASSERT_TRUE(check_run_folder(folder.file("out")));
  ASSERT_TRUE(OneBody(result()).write(folder.file("out")));
  EXPECT_FALSE(std::filesystem::exists(folder.file("out/hall.tum")));
  EXPECT_TRUE(read_run(folder.file("out/table.tum"), 1));
}

TEST(RunFiles, ATrajectoryOfAnotherRunIsNeverScored) {
  const TemporaryFolder folder;
  ASSERT_TRUE(OneBody(result()).write(folder.file("out")));
  ASSERT_TRUE(write_whole_file(folder.file("out/hall.tum"), "1.0 0 0 0 0 0 0 1\n"));
  const auto run = read_run(folder.file("out/hall.tum"), 1);
  ASSERT_FALSE(run);
  EXPECT_THAT(run.error().text(), HasSubstr("another run"));
}

TEST(RunFiles, FilesThatNobodyKnowsAreRefused) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_whole_file(folder.file("out/map.csv"), "id,size\n"));
  const auto checked = check_run_folder(folder.file("out"));
  ASSERT_FALSE(checked);
  EXPECT_THAT(checked.error().text(), HasSubstr("map.csv"));
}

TEST(RunFiles, CovariancesAndEventsAreThere) {
  const TemporaryFolder folder;
  OfflineResult r = result();
  r.covariances = {{r.trajectory[0].at, Matrix6d::Identity() * 0.25}};
  r.events = {{BodyEvent::Kind::kReset, instant_from_ns(5), -1, {}, {}}};
  OneBody run(r);
  run.session.map_events = {
      {instant_from_ns(3), {MapEvent::Kind::kTagAdded, 4, "tag 4 joined the map, seen by body 1"}}};
  ASSERT_TRUE(run.write(folder.file("out")));
  const auto covariance = read_whole_file(folder.file("out/table.covariance.csv"));
  ASSERT_TRUE(covariance);
  EXPECT_THAT(*covariance, HasSubstr("\n1000000001,0.25,0,0,0,0,0,0.25,"));
  const auto events = read_whole_file(folder.file("out/events.csv"));
  ASSERT_TRUE(events);
  EXPECT_THAT(*events, HasSubstr("\n3,,tag_added,4,0,0,tag 4 joined the map; seen by body 1\n"
                                 "5,table,reset,,0,0,\n"));
}

TEST(Extrinsics, RefuseWhatIsNoRotation) {
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

TEST(ReadRun, NamesTheFileThatIsMissing) {
  const TemporaryFolder folder;
  ASSERT_TRUE(OneBody(result()).write(folder.file("")));
  std::filesystem::remove(folder.file("extrinsics.yaml"));
  EXPECT_THAT(read_run(folder.file("table.tum"), 1).error().context, HasSubstr("extrinsics.yaml"));
  std::filesystem::remove(folder.file("map.csv"));
  EXPECT_THAT(read_run(folder.file("table.tum"), 1).error().context, HasSubstr("map.csv"));
}

}  // namespace
}  // namespace fiducap
