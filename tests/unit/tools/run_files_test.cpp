#include "tools/replay/run_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/so3.hpp"
#include "support/temporary_folder.hpp"
#include "tools/replay/evaluation.hpp"
#include "tools/whole_file.hpp"

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

TEST(RunFiles, WhatIsWrittenReadsBackAsTheSameRun) {
  const TemporaryFolder folder;
  const OfflineResult written = result();
  ASSERT_TRUE(write_run_files(folder.file("out"), "table", OfflineSetup{}, written));
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

TEST(RunFiles, ReportCarriesTheFigures) {
  const auto report = nlohmann::json::parse(run_report("table", OfflineSetup{}, result()));
  EXPECT_EQ(report["frames"], 40);
  EXPECT_EQ(report["frames_with_pose"], 39);
  EXPECT_EQ(report["tags_mapped"], 1);
  EXPECT_DOUBLE_EQ(report["cpu_s"]["filter_per_second_of_data"], 0.5);
  EXPECT_DOUBLE_EQ(report["filter_statistics"]["nis_per_dof"], 0.9);
}

TEST(RunFiles, AKnownTagThatIsAlsoInTheStateIsListedOnce) {
  OfflineResult r = result();
  r.tags[0].tag.tag_id = 3;
  const TagMap map = run_map(OfflineSetup{}, r);
  ASSERT_EQ(map.tags.size(), 1u);
  EXPECT_EQ(map.tags[0].state, TagState::kSurveyed);
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
  ASSERT_TRUE(write_run_files(folder.file(""), "table", OfflineSetup{}, result()));
  std::filesystem::remove(folder.file("extrinsics.yaml"));
  EXPECT_THAT(read_run(folder.file("table.tum"), 1).error().context, HasSubstr("extrinsics.yaml"));
  std::filesystem::remove(folder.file("map.csv"));
  EXPECT_THAT(read_run(folder.file("table.tum"), 1).error().context, HasSubstr("map.csv"));
}

}  // namespace
}  // namespace fiducap
