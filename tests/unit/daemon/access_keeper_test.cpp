#include "daemon/access_keeper.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <filesystem>

#include "base/whole_file.hpp"
#include "support/fake_clock.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const Requester kOperator{"native", kOperatorRight, "10.0.0.7:1511"};
const Requester kStranger{"web", {}, "10.0.0.66:4711"};

class AccessKeeperTest : public testing::Test {
 protected:
  std::vector<std::string> lines(const std::string& file) const {
    std::istringstream text(value_of(read_whole_file(file)));
    std::vector<std::string> all;
    for (std::string line; std::getline(text, line);) all.push_back(line);
    return all;
  }
  /// In one step, as administrators should.
  void write_token(const std::string& text) const {
    value_of(write_whole_file(token_, text + "\n", 0600));
  }
  std::vector<std::string> conditions() const {
    std::vector<std::string> all;
    for (const Event& one : events_.standing()) all.push_back(one.sentence());
    return all;
  }

  TemporaryFolder folder_;
  const std::string audit_ = folder_.file("audit.jsonl");
  const std::string token_ = folder_.file("token");
  FakeClock clock_;
  EventBoard events_{[] { return std::int64_t{0}; }};
};

TEST_F(AccessKeeperTest, WritesWhoWhatAndResultOfAChange) {
  AccessKeeper access({.audit_file = audit_}, events_, clock_);
  access.note(kOperator, "rename body 1 to \"a\x1b]0;b\"", {});
  access.note(kOperator, "stop the recording", fail(ErrorCode::kUnavailable, "none is running"));
  access.note_refusal(kStranger, "prove a token", "wrong token");
  access.tick();
  const auto all = lines(audit_);
  ASSERT_THAT(all, SizeIs(3));
  EXPECT_THAT(all[0], AllOf(testing::MatchesRegex("[{]\"utc\":\"20..-..-..T..:..:..[.]...Z\".*"),
                            HasSubstr("\"protocol\":\"native\",\"address\":\"10.0.0.7:1511\","
                                      "\"right\":\"operator token\""),
                            HasSubstr("a\\\\x1b]0;b"), HasSubstr("\"result\":\"done\"")));
  EXPECT_THAT(all[1], HasSubstr("\"result\":\"failed: none is running\""));
  EXPECT_THAT(all[2],
              AllOf(HasSubstr("\"right\":\"\""), HasSubstr("\"result\":\"refused: wrong token\"")));
  struct stat about {};
  ASSERT_EQ(::stat(audit_.c_str(), &about), 0);
  EXPECT_EQ(about.st_mode & 07, 0u) << "not for others";
}

TEST_F(AccessKeeperTest, FloodOfRefusalsTakesLittleSpaceAndHidesNoChange) {
  AccessKeeper access({.audit_file = audit_}, events_, clock_);
  for (int i = 0; i < 100'000; ++i) access.note_refusal(kStranger, "prove a token", "wrong token");
  access.note(kOperator, "freeze the map", {});
  access.tick();
  EXPECT_THAT(lines(audit_), SizeIs(AccessKeeper::kRefusals + 1));
  clock_.advance(1min);
  access.note_refusal(kStranger, "prove a token", "wrong token");
  access.tick();
  EXPECT_THAT(lines(audit_).back(), HasSubstr("\"omitted_refusals\":99980"));
}

TEST_F(AccessKeeperTest, FilesAreReplacedWhenTheyAreLarge) {
  AccessKeeper access({.audit_file = audit_}, events_, clock_);
  const std::string large(AccessKeeper::kLargestFile_bytes, 'x');
  for (int i = 0; i < AccessKeeper::kOlderFiles + 3; ++i) {
    value_of(write_whole_file(audit_, std::to_string(i) + large));
    access.note(kOperator, "freeze the map", {});
    access.tick();
    EXPECT_THAT(lines(audit_), SizeIs(1));
  }
  EXPECT_EQ(value_of(read_whole_file(audit_ + ".1")).front(), '6') << "the newest";
  EXPECT_EQ(value_of(read_whole_file(audit_ + ".4")).front(), '3');
  EXPECT_FALSE(std::filesystem::exists(audit_ + ".5"));
}

TEST_F(AccessKeeperTest, FailingDiskIsReportedUntilItWorks) {
  const std::string missing = folder_.file("none/audit.jsonl");
  AccessKeeper access({.audit_file = missing}, events_, clock_);
  access.note(kOperator, "freeze the map", {});
  access.tick();
  EXPECT_THAT(conditions(), testing::ElementsAre(HasSubstr("the audit log cannot be written")));
  std::filesystem::create_directory(folder_.file("none"));
  access.note(kOperator, "let the map grow", {});
  access.tick();
  EXPECT_THAT(conditions(), IsEmpty());
}

TEST_F(AccessKeeperTest, FollowsNoLink) {
  value_of(write_whole_file(folder_.file("target"), "precious"));
  std::filesystem::create_symlink(folder_.file("target"), audit_);
  AccessKeeper access({.audit_file = audit_}, events_, clock_);
  access.note(kOperator, "freeze the map", {});
  access.tick();
  EXPECT_THAT(conditions(), SizeIs(1));
  EXPECT_EQ(value_of(read_whole_file(folder_.file("target"))), "precious");
}

TEST_F(AccessKeeperTest, ReplacedTokenFileIsReadWithoutARestart) {
  write_token("first token");
  AccessKeeper access(value_of(with_tokens({.token_file = token_, .audit_file = audit_}, nullptr)),
                      events_, clock_);
  access.tick();
  EXPECT_EQ(access.tokens_changed(), 0u);
  write_token("second token");
  access.tick();
  EXPECT_EQ(access.token(), "second token");
  EXPECT_EQ(access.read_token(), "");
  EXPECT_EQ(access.tokens_changed(), 1u);
  access.tick();
  EXPECT_THAT(lines(audit_), testing::ElementsAre(AllOf(HasSubstr("operator.token_file"),
                                                        HasSubstr("replace the token"),
                                                        Not(HasSubstr("second token")))));
}

TEST_F(AccessKeeperTest, UnusableTokenFileKeepsTheEarlierTokenAndIsReported) {
  write_token("first token");
  AccessKeeper access(value_of(with_tokens({.read_token_file = token_}, nullptr)), events_, clock_);
  const auto expect_kept = [&](const char* why) {
    access.tick();
    EXPECT_EQ(access.read_token(), "first token");
    EXPECT_THAT(conditions(),
                testing::ElementsAre(AllOf(HasSubstr("operator.read_token_file"), HasSubstr(why))));
  };
  write_token("short");
  expect_kept("at least 8 characters");
  write_token("");
  expect_kept("is empty");
  value_of(write_whole_file(token_, "second token\n", 0644));
  std::filesystem::permissions(token_, std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  expect_kept("chmod 600");
  std::filesystem::remove(token_);
  expect_kept("No such file");
  write_token("second token");
  access.tick();
  EXPECT_EQ(access.read_token(), "second token");
  EXPECT_THAT(conditions(), IsEmpty());
}

}  // namespace
}  // namespace fiducap
