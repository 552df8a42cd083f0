#include "daemon/operator_service.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>
#include <sstream>

#include "base/whole_file.hpp"
#include "daemon/operator_token.hpp"
#include "support/fake_clock.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "unit/mapping/solution_fixture.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;

const Requester kBy{"native", kOperatorRight, "10.0.0.7:1511"};

class OperatorServiceTest : public testing::Test {
 protected:
  static std::vector<SceneBody> bodies() {
    std::vector<SceneBody> all(2);
    all[0].description = {4, "drone"};
    all[1].description = {7, "rover"};
    return all;
  }
  void map_tag(int id, double x = 1.0, double y = 0.0) {
    GraphTagEstimate one = graph_estimate(id, x, 0, 1e-4);
    one.X_WT.p.y() = y;
    map_.adopt(solution_with(one), kNow_utc_ns);
  }

  TemporaryFolder folder_;
  Scene scene_{bodies()};
  MapBuilder map_{MapConfig{}, TagMap{}};
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
  SessionRecorder recorder_{RecorderConfig{folder_.file("recordings"), false}, clock_, events_};
  std::string store_{folder_.file("hall.map")};
  MapKeeper keeper_{value_of(MapStore::open(store_)),         map_, 10.0, clock_, events_,
                    [] { return std::vector<LearnedBody>{}; }};
  AccessKeeper no_tokens_{{}, events_, clock_};
  AccessKeeper access_{{.token = "correct horse"}, events_, clock_};
  OperatorService service_{access_, scene_, map_, recorder_, events_, &keeper_};
};

TEST_F(OperatorServiceTest, AdmitsTheTokenOnly) {
  EXPECT_TRUE(service_.admits("correct horse"));
  for (const char* wrong : {"correct hors", "correct horsf", ""})
    EXPECT_FALSE(service_.admits(wrong)) << wrong;
  const OperatorService closed(no_tokens_, scene_, map_, recorder_, events_, nullptr);
  EXPECT_FALSE(closed.admits("")) << "without a token there is no operator";
}

TEST_F(OperatorServiceTest, IdentifiesBodiesByTheirStreamingId) {
  ASSERT_TRUE(service_.set_enabled(kBy, 7, false));
  EXPECT_EQ(scene_.model()->bodies.size(), 1u);
  EXPECT_FALSE(service_.bodies()[1].enabled);
  EXPECT_EQ(service_.set_enabled(kBy, 5, false).error().code, ErrorCode::kNotFound);
}

TEST_F(OperatorServiceTest, EveryChangeIsAudited) {
  const std::string file = folder_.file("audit.jsonl");
  AccessKeeper access({.token = "correct horse", .audit_file = file}, events_, clock_);
  OperatorService service(access, scene_, map_, recorder_, events_, &keeper_);
  map_tag(3);
  (void)service.set_enabled(kBy, 7, false);
  (void)service.rename(kBy, 4, "uav");
  (void)service.set_pivot(kBy, 4, {Eigen::Quaterniond::Identity(), {0.1, 0, 0}});
  (void)service.start_recording(kBy, "flight");
  (void)service.stop_recording(kBy);
  for (const MapChange& one :
       {MapChange{CommitVersion{"now"}}, MapChange{NameVersion{9, "x"}}, MapChange{RollBack{9}},
        MapChange{AlignMap{}}, MapChange{QuarantineTag{3}}, MapChange{ForgetTag{3}}})
    (void)service.change_map(kBy, one);
  (void)service.set_map_mode(kBy, MapMode::kFrozen);
  service.note_refusal(kBy, "prove a token", "wrong token");
  access.tick();
  std::istringstream lines(value_of(read_whole_file(file)));
  for (const char* what :
       {"disable body 7", "rename body 4 to", "move the pivot of body 4 to 0.1, 0, 0 m",
        "start the recording", "stop the recording", "store the map as", "name version 9",
        "roll the map back to version 9", "align the map to 0 tags", "quarantine tag 3",
        "forget tag 3", "freeze the map", "prove a token"}) {
    std::string line;
    std::getline(lines, line);
    EXPECT_THAT(line, testing::AllOf(HasSubstr(what), HasSubstr("10.0.0.7:1511")));
  }
}

TEST_F(OperatorServiceTest, RefusesInvalidAndTakenNames) {
  EXPECT_TRUE(service_.rename(kBy, 4, "drone-2"));
  EXPECT_TRUE(service_.rename(kBy, 4, "drone-2")) << "its own name";
  EXPECT_EQ(service_.rename(kBy, 4, "rover").error().code, ErrorCode::kInvalid);
  for (const std::string& bad : {std::string(), std::string("a@b"), std::string(64, 'a')})
    EXPECT_FALSE(service_.rename(kBy, 4, bad)) << bad;
  EXPECT_EQ(service_.bodies()[0].name, "drone-2");
  EXPECT_TRUE(service_.rename(kBy, 4, "Größe 1"));
  EXPECT_EQ(service_.bodies()[0].name, "Größe 1");
}

TEST_F(OperatorServiceTest, RenamesTheSubjectOfEvents) {
  events_.begin({.subject = "drone", .kind = "silent", .text = "no image"});
  ASSERT_TRUE(service_.rename(kBy, 4, "uav1"));
  ASSERT_TRUE(service_.rename(kBy, 4, "uav2"));
  events_.begin({.subject = "drone", .kind = "tracking", .text = "is lost"});
  for (const Event& event : events_.standing()) EXPECT_EQ(event.subject, "uav2") << event.kind;
}

TEST_F(OperatorServiceTest, RefusesAPivotWithoutARotation) {
  Pose X_BP{Eigen::Quaterniond::Identity(), {1, 2, 3}};
  EXPECT_TRUE(service_.set_pivot(kBy, 4, X_BP));
  EXPECT_EQ(service_.bodies()[0].X_BP.p, Eigen::Vector3d(1, 2, 3));
  X_BP.q.coeffs() *= 2;
  EXPECT_FALSE(service_.set_pivot(kBy, 4, X_BP));
  X_BP.q.coeffs().setConstant(std::nan(""));
  EXPECT_FALSE(service_.set_pivot(kBy, 4, X_BP));
}

TEST_F(OperatorServiceTest, DoesNotFreezeAnEmptyMap) {
  EXPECT_THAT(error_of(service_.set_map_mode(kBy, MapMode::kFrozen)),
              HasSubstr("no tag in the map yet"));
  EXPECT_EQ(map_.mode(), MapMode::kMapping);
}

TEST_F(OperatorServiceTest, FreezesAndStoresTheMap) {
  map_tag(9);
  EXPECT_TRUE(service_.set_map_mode(kBy, MapMode::kFrozen));
  EXPECT_EQ(map_.mode(), MapMode::kFrozen);
  EXPECT_TRUE(service_.change_map(kBy, CommitVersion{"as it was"}));
  keeper_.commit();
  keeper_.update_cache();
  ASSERT_EQ(service_.map_versions().size(), 1U);
  EXPECT_EQ(service_.map_versions().front().comment, "as it was");
  OperatorService without_store(no_tokens_, scene_, map_, recorder_, events_, nullptr);
  EXPECT_EQ(without_store.change_map(kBy, CommitVersion{}).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(without_store.change_map(kBy, RollBack{1}).error().code, ErrorCode::kUnavailable)
      << "frozen";
  EXPECT_TRUE(without_store.map_versions().empty());
}

TEST_F(OperatorServiceTest, RefusesImpossibleChangesOfTheMap) {
  const auto why = [&](const MapChange& change) {
    return error_of(service_.change_map(kBy, change));
  };
  EXPECT_THAT(why(RollBack{7}), HasSubstr("there is no version 7 in the store"));
  EXPECT_THAT(why(NameVersion{7, "x"}), HasSubstr("there is no version 7"));
  EXPECT_THAT(why(NameVersion{1, "two\nlines"}), HasSubstr("1 to 200 characters"));
  EXPECT_THAT(why(CommitVersion{kAutomaticComment}), HasSubstr("stored by itself"));
  EXPECT_THAT(why(QuarantineTag{3}), HasSubstr("has no tag 3"));
  EXPECT_THAT(why(ForgetTag{3}), HasSubstr("has no tag 3"));
  EXPECT_THAT(why(AlignMap{{{3, Eigen::Vector3d::Zero()}}}), HasSubstr("tag 3 is not in version"));
  map_tag(9);
  ASSERT_TRUE(service_.set_map_mode(kBy, MapMode::kFrozen));
  EXPECT_THAT(why(RollBack{7}), HasSubstr("the map is frozen"));
}

TEST_F(OperatorServiceTest, ReportsChangesOfTags) {
  for (const int id : {3, 4, 5}) map_tag(id, id, id == 4 ? 2 : 0);
  ASSERT_EQ(map_.snapshot()->tags.size(), 3U);
  AlignMap align;
  for (const MapTag& tag : map_.snapshot()->tags)
    align.places.push_back({tag.tag.tag_id, tag.tag.X_WT.p + Eigen::Vector3d(10, 20, 0)});
  EXPECT_TRUE(service_.change_map(kBy, align));
  EXPECT_NEAR(map_.snapshot()->X_RW.p.y(), 20, 1e-9);
  EXPECT_TRUE(service_.change_map(kBy, QuarantineTag{3}));
  EXPECT_TRUE(service_.change_map(kBy, ForgetTag{4}));
  std::vector<std::string> kinds;
  for (const Event& event : events_.after(0)) kinds.push_back(event.kind);
  EXPECT_EQ(kinds, (std::vector<std::string>{"aligned", "tag_quarantined", "tag_forgotten"}));
}

TEST_F(OperatorServiceTest, NamesARecordingByTheTime) {
  ASSERT_TRUE(service_.start_recording(kBy, ""));
  EXPECT_EQ(service_.recording()->size(), std::string("2026-01-01_00-00-00").size());
  EXPECT_FALSE(service_.start_recording(kBy, "another"));
  EXPECT_TRUE(service_.stop_recording(kBy));
  EXPECT_FALSE(service_.recording());
}

class OperatorTokenTest : public testing::Test {
 protected:
  std::string write(const std::string& text, mode_t mode = 0600) {
    const std::string path = folder_.file("token");
    std::ofstream(path, std::ios::binary) << text;
    EXPECT_EQ(::chmod(path.c_str(), mode), 0);
    return path;
  }
  std::string refused(const std::string& text, mode_t mode = 0600) {
    return error_of(read_token_file(write(text, mode)));
  }

  TemporaryFolder folder_;
};

TEST_F(OperatorTokenTest, IsTheLineOfTheFile) {
  for (const char* text : {"correct horse", "correct horse\n", "correct horse\r\n"})
    EXPECT_EQ(value_of(read_token_file(write(text))), "correct horse");
}

TEST_F(OperatorTokenTest, RefusesAFileThatOthersCanReadOrChange) {
  for (const mode_t mode : {0604, 0602, 0601, 0620, 0666})
    EXPECT_THAT(refused("correct horse", mode), HasSubstr("chmod 600")) << std::oct << mode;
  EXPECT_TRUE(read_token_file(write("correct horse", 0440)))
      << "a credential of systemd shows its access list as rights of the group";
}

TEST_F(OperatorTokenTest, RefusesInvalidTokensWithTheFilesName) {
  EXPECT_THAT(refused("short"), HasSubstr("at least 8 characters"));
  EXPECT_THAT(refused("two lines\nof a file"), HasSubstr("one line"));
  EXPECT_THAT(refused(std::string("nul\0 inside", 11)), HasSubstr("one line"));
  EXPECT_THAT(refused(std::string(1025, 'a')), HasSubstr("too long"));
  EXPECT_THAT(refused("short"), HasSubstr(folder_.file("token")));
}

TEST_F(OperatorTokenTest, RefusesOtherThanPlainFiles) {
  EXPECT_THAT(error_of(read_token_file(folder_.file("none"))), HasSubstr("No such file"));
  EXPECT_THAT(error_of(read_token_file(folder_.text())), HasSubstr("plain file"));
  const std::string pipe = folder_.file("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(error_of(read_token_file(pipe)), HasSubstr("plain file"));
}

std::string token_with(const OperatorConfig& config, const char* credentials) {
  return value_of(with_tokens(config, credentials)).token;
}

TEST_F(OperatorTokenTest, PrefersTheConfigurationToTheCredential) {
  const std::string file = write("of the file\n");
  const std::string folder = folder_.text();
  EXPECT_EQ(token_with({.token = "of the text"}, folder.c_str()), "of the text");
  EXPECT_EQ(token_with({.token_file = file}, "/nowhere"), "of the file");
  EXPECT_EQ(token_with({}, folder.c_str()), "of the file");
  EXPECT_EQ(token_with({}, nullptr), "");
  EXPECT_EQ(token_with({}, "/nowhere"), "") << "a service without this credential";
}

TEST_F(OperatorTokenTest, AcceptsAnEmptyCredentialButNoEmptyFile) {
  const std::string file = write("\n");
  const std::string folder = folder_.text();
  EXPECT_EQ(token_with({}, folder.c_str()), "");
  EXPECT_THAT(error_of(with_tokens({.token_file = file}, nullptr)), HasSubstr("is empty"));
}

TEST_F(OperatorTokenTest, RefusesTwoTokens) {
  EXPECT_TRUE((OperatorConfig{.token_file = "/etc/token"}.check().empty()));
  const auto faults = OperatorConfig{.token = "correct horse", .token_file = "/etc/token"}.check();
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_THAT(faults[0].text(), HasSubstr("remove one of"));
  EXPECT_THAT(faults[0].text(), testing::Not(HasSubstr("correct horse")));
}

}  // namespace
}  // namespace fiducap
