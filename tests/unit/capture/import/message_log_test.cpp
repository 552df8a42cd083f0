#include "capture/import/message_log.hpp"

#include <gmock/gmock.h>

#include "support/log_files.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using test::LogFileOptions;
using test::StoredMessage;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::vector<StoredMessage> kMessages{{"/imu0", "sensor_msgs/Imu", 5'000'000'001, "one"},
                                           {"/cam0", "sensor_msgs/Image", 5'000'000'002, "two"},
                                           {"/imu0", "sensor_msgs/Imu", 5'000'000'003, "three"},
                                           {"/imu0", "sensor_msgs/Imu", 5'000'000'004, "four"}};

/// What a log gave, as text.
struct Read {
  std::vector<std::string> messages;
  std::vector<std::string> remarks;
};

Read read_all(const std::string& path) {
  auto log = open_message_log(path);
  if (!log) return {{log.error().text()}, {}};
  Read read;
  LoggedMessage message;
  for (auto more = (*log)->next(message); more && *more; more = (*log)->next(message)) {
    const LoggedTopic& topic = (*log)->topics()[message.topic];
    read.messages.push_back(
        topic.name + " " + topic.type + " " + std::to_string(message.logged_ns) + " " +
        std::string(reinterpret_cast<const char*>(message.bytes.data()), message.bytes.size()));
  }
  read.remarks = (*log)->remarks();
  return read;
}

const auto kAll =
    ElementsAre("/imu0 sensor_msgs/Imu 5000000001 one", "/cam0 sensor_msgs/Image 5000000002 two",
                "/imu0 sensor_msgs/Imu 5000000003 three", "/imu0 sensor_msgs/Imu 5000000004 four");

class MessageLogTest : public testing::Test {
 protected:
  Read read(const std::string& name, const std::string& content) {
    return read_all(folder_.write(name, content));
  }
  TemporaryFolder folder_;
};

TEST_F(MessageLogTest, BagsOfEveryCompressionGiveTheirMessages) {
  for (const char* compression : {"none", "bz2", "lz4"}) {
    const Read bag = read("a.bag", bag_file(kMessages, {compression}));
    EXPECT_THAT(bag.messages, kAll) << compression;
    EXPECT_THAT(bag.remarks, IsEmpty()) << compression;
  }
}

TEST_F(MessageLogTest, ABagWithoutIndexIsReadAndThatIsSaid) {
  LogFileOptions options;
  options.closed = false;
  const Read bag = read("a.bag", bag_file(kMessages, options));
  EXPECT_THAT(bag.messages, kAll);
  EXPECT_THAT(bag.remarks, ElementsAre(HasSubstr("has no index")));
}

TEST_F(MessageLogTest, ACutBagIsReadUpToWhereItIsWhole) {
  LogFileOptions options{"lz4", 1};
  options.closed = false;
  const std::string whole = bag_file(kMessages, options);
  std::size_t most = 0;
  for (std::size_t n = 13; n < whole.size(); n += n < 4000 ? 997 : 13) {
    const Read bag = read("a.bag", whole.substr(0, n));
    most = std::max(most, bag.messages.size());
    if (n > 4096 && n + 40 < whole.size()) {
      EXPECT_THAT(bag.remarks,
                  Contains(testing::AnyOf(HasSubstr("is truncated"), HasSubstr("no index"))))
          << n;
    }
  }
  EXPECT_EQ(most, 4u);
}

TEST_F(MessageLogTest, ADamagedChunkCostsItsMessagesOnly) {
  std::string content = bag_file(kMessages, {"bz2", 3});
  content[content.rfind("BZh") + 12] ^= 0x55;
  const Read bag = read("a.bag", content);
  EXPECT_THAT(bag.messages, ElementsAre(HasSubstr("one"), HasSubstr("two"), HasSubstr("three")));
  EXPECT_THAT(bag.remarks, ElementsAre(HasSubstr("a chunk cannot be unpacked")));
}

TEST_F(MessageLogTest, McapOfEveryCompressionAndProfileGivesItsMessages) {
  for (const char* compression : {"none", "lz4", "zstd"}) {
    for (const bool ros2 : {false, true}) {
      LogFileOptions options{compression};
      options.ros2 = ros2;
      const Read mcap = read("a.mcap", mcap_file(kMessages, options));
      EXPECT_THAT(mcap.messages, kAll) << compression;
      EXPECT_THAT(mcap.remarks, IsEmpty()) << compression << ros2;
      options.closed = false;
      const Read open = read("b.mcap", mcap_file(kMessages, options));
      EXPECT_THAT(open.messages, kAll) << "without a summary";
      EXPECT_THAT(open.remarks, ElementsAre(HasSubstr("was not closed")));
    }
  }
}

TEST_F(MessageLogTest, AChunkOfAnotherChecksumIsLeftOut) {
  LogFileOptions options{"zstd", 1};
  options.wrong_crc = true;
  const Read mcap = read("a.mcap", mcap_file(kMessages, options));
  EXPECT_THAT(mcap.messages, ElementsAre("/cam0 sensor_msgs/Image 5000000002 two"))
      << "the channel of the others was in that chunk";
  EXPECT_THAT(mcap.remarks, ElementsAre(HasSubstr("a chunk has a wrong checksum")));
}

TEST_F(MessageLogTest, ChecksumsOverDataAndSummaryAreChecked) {
  LogFileOptions options{"none", 10};
  std::string mcap = mcap_file(kMessages, options);
  mcap[mcap.find("fiducap tests")] ^= 1;
  EXPECT_THAT(read("a.mcap", mcap).remarks, ElementsAre(HasSubstr("checksum over all data")));
  mcap = mcap_file(kMessages, options);
  mcap[mcap.rfind("sensor_msgs/Imu")] ^= 1;
  EXPECT_THAT(read("a.mcap", mcap).remarks, ElementsAre(HasSubstr("the summary has a wrong")));
}

TEST_F(MessageLogTest, AnSqliteFileOfRosbag2GivesItsMessages) {
  test::write_db3(folder_.file("a.db3"), kMessages);
  const Read db3 = read_all(folder_.file("a.db3"));
  EXPECT_THAT(db3.messages, kAll);
  EXPECT_THAT(db3.remarks, IsEmpty());
}

TEST_F(MessageLogTest, AFolderOfRosbag2IsReadFileAfterFile) {
  const std::vector<StoredMessage> first(kMessages.begin(), kMessages.begin() + 2);
  const std::vector<StoredMessage> second(kMessages.begin() + 2, kMessages.end());
  // In the order of metadata.yaml, not of the names; older recorders wrote the folder before them.
  test::write_db3(folder_.file("b_0.db3"), first);
  test::write_db3(folder_.file("a_1.db3"), second);
  folder_.write("metadata.yaml",
                "rosbag2_bagfile_information:\n  version: 4\n  storage_identifier: sqlite3\n"
                "  relative_file_paths:\n    - walk/b_0.db3\n    - a_1.db3\n    - gone_2.db3\n"
                "  compression_format: \"\"\n  compression_mode: \"\"\n");
  const Read bag = read_all(folder_.text());
  EXPECT_THAT(bag.messages, kAll);
  EXPECT_THAT(bag.remarks, ElementsAre(HasSubstr("lacks gone_2.db3")));
}

TEST_F(MessageLogTest, AFolderWithoutMetadataIsReadByName) {
  LogFileOptions options;
  options.ros2 = true;
  folder_.write("a_0.mcap", mcap_file(kMessages, options));
  const Read bag = read_all(folder_.text());
  EXPECT_THAT(bag.messages, kAll);
  EXPECT_THAT(bag.remarks, ElementsAre(HasSubstr("has no metadata.yaml")));
}

TEST_F(MessageLogTest, OtherFilesAreNamedForWhatTheyAreNot) {
  EXPECT_THAT(read("a", "hello").messages, ElementsAre(HasSubstr("is neither a bag of ROS 1")));
  EXPECT_THAT(read("a.bag", "#ROSBAG V1.2\n").messages, ElementsAre(HasSubstr("format 1.2")));
  EXPECT_THAT(read("a.db3", "SQLite format 3").messages, ElementsAre(HasSubstr("a.db3: is no")));
  EXPECT_THAT(read_all(folder_.file("none")).messages, ElementsAre(HasSubstr("no such file")));
}

// A record of 4 GB in a file of 30 bytes.
TEST_F(MessageLogTest, LengthsThatTheFileDoesNotHaveCostNothing) {
  const std::string bag = "#ROSBAG V2.0\n" + std::string("\xff\xff\xff\xff", 4);
  EXPECT_THAT(read("a.bag", bag).messages, ElementsAre(HasSubstr("ends before its header")));
  const std::string mcap("\x89MCAP0\r\n\x06\xff\xff\xff\xff\xff\xff\xff\x7f", 17);
  const Read cut = read("a.mcap", mcap);
  EXPECT_THAT(cut.messages, IsEmpty());
  EXPECT_THAT(cut.remarks, ElementsAre(HasSubstr("of 17 bytes the first 8 are complete")));
}

}  // namespace
}  // namespace fiducap
