#include "capture/import/message_log.hpp"

#include <gmock/gmock.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zstd.h>

#include <filesystem>
#include <fstream>

#include "support/log_files.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap {
namespace {

using test::LogFileOptions;
using test::StoredMessage;
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
  template <typename Remarks>
  static void expect_all(const Read& log, const Remarks& remarks) {
    EXPECT_THAT(log.messages, kAll);
    EXPECT_THAT(log.remarks, remarks);
  }
  TemporaryFolder folder_;
};

TEST_F(MessageLogTest, ReadsBagsOfEveryCompression) {
  for (const char* compression : {"none", "bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    expect_all(read("a.bag", bag_file(kMessages, {compression})), IsEmpty());
    // It could contain itself, and be unpacked without end.
    const Read nested =
        read("a.bag", bag_file(kMessages, {.compression = compression, .nested = true}));
    EXPECT_THAT(nested.messages, IsEmpty());
    EXPECT_THAT(nested.remarks, testing::Contains(HasSubstr("a chunk contains a chunk")));
  }
  expect_all(read("a.bag", bag_file(kMessages, {.closed = false})),
             ElementsAre(HasSubstr("has no index")));
}

TEST_F(MessageLogTest, ReadsATruncatedBagUpToTheCut) {
  const std::string whole =
      bag_file(kMessages, {.compression = "lz4", .messages_per_chunk = 1, .closed = false});
  std::size_t most = 0;
  for (std::size_t n = 13; n < whole.size(); n += n < 4000 ? 997 : 13) {
    const Read bag = read("a.bag", whole.substr(0, n));
    most = std::max(most, bag.messages.size());
    if (n <= 4096 || n + 40 >= whole.size()) continue;
    EXPECT_THAT(bag.remarks,
                testing::Contains(testing::AnyOf(HasSubstr("is truncated"), HasSubstr("no index"))))
        << n;
  }
  EXPECT_EQ(most, 4u);
}

TEST_F(MessageLogTest, DropsADamagedChunk) {
  std::string content = bag_file(kMessages, {"bz2", 3});
  content[content.rfind("BZh") + 12] ^= 0x55;
  const Read bag = read("a.bag", content);
  EXPECT_THAT(bag.messages, ElementsAre(HasSubstr("one"), HasSubstr("two"), HasSubstr("three")));
  EXPECT_THAT(bag.remarks, ElementsAre(HasSubstr("a chunk cannot be unpacked")));
}

TEST_F(MessageLogTest, ReadsMcapOfEveryCompressionAndProfile) {
  for (const char* compression : {"none", "lz4", "zstd"}) {
    for (const bool ros2 : {false, true}) {
      SCOPED_TRACE(testing::Message() << compression << ros2);
      LogFileOptions options{.compression = compression, .ros2 = ros2};
      expect_all(read("a.mcap", mcap_file(kMessages, options)), IsEmpty());
      options.closed = false;
      expect_all(read("b.mcap", mcap_file(kMessages, options)),
                 ElementsAre(HasSubstr("was not closed")));
    }
  }
}

TEST_F(MessageLogTest, DropsAChunkWithAWrongChecksum) {
  const Read mcap = read(
      "a.mcap",
      mcap_file(kMessages, {.compression = "zstd", .messages_per_chunk = 1, .wrong_crc = true}));
  EXPECT_THAT(mcap.messages, ElementsAre("/cam0 sensor_msgs/Image 5000000002 two"))
      << "the channel of the others was in that chunk";
  EXPECT_THAT(mcap.remarks, ElementsAre(HasSubstr("a chunk has a wrong checksum")));
}

TEST_F(MessageLogTest, ChecksTheSumsOverDataAndSummary) {
  LogFileOptions options{"none", 10};
  std::string mcap = mcap_file(kMessages, options);
  mcap[mcap.find("fiducap tests")] ^= 1;
  EXPECT_THAT(read("a.mcap", mcap).remarks, ElementsAre(HasSubstr("checksum over all data")));
  mcap = mcap_file(kMessages, options);
  mcap[mcap.rfind("sensor_msgs/Imu")] ^= 1;
  EXPECT_THAT(read("a.mcap", mcap).remarks, ElementsAre(HasSubstr("the summary has a wrong")));
}

TEST_F(MessageLogTest, ReadsFilesAndFoldersOfRosbag2) {
  const TemporaryFolder other;
  test::write_db3(other.file("a.db3"), kMessages);
  expect_all(read_all(other.file("a.db3")), IsEmpty());
  // In the order of metadata.yaml, not of the names; older recorders wrote the folder before them.
  const auto middle = kMessages.begin() + 2;
  test::write_db3(folder_.file("b_0.db3"), {kMessages.begin(), middle});
  test::write_db3(folder_.file("a_1.db3"), {middle, kMessages.end()});
  folder_.write("metadata.yaml",
                "rosbag2_bagfile_information:\n  version: 4\n  storage_identifier: sqlite3\n"
                "  relative_file_paths:\n    - walk/b_0.db3\n    - a_1.db3\n    - gone_2.db3\n"
                "  compression_format: \"\"\n  compression_mode: \"\"\n");
  expect_all(read_all(folder_.text()), ElementsAre(HasSubstr("lacks gone_2.db3")));
}

TEST_F(MessageLogTest, ReadsAFolderWithoutMetadataByName) {
  folder_.write("a_0.mcap", mcap_file(kMessages, {.ros2 = true}));
  expect_all(read_all(folder_.text()), ElementsAre(HasSubstr("has no metadata.yaml")));
}

TEST_F(MessageLogTest, RefusesOtherFilesWithTheReason) {
  EXPECT_THAT(read("a", "hello").messages, ElementsAre(HasSubstr("is neither a bag of ROS 1")));
  EXPECT_THAT(read("a.bag", "#ROSBAG V1.2\n").messages, ElementsAre(HasSubstr("format 1.2")));
  EXPECT_THAT(read("a.db3", "SQLite format 3").messages, ElementsAre(HasSubstr("a.db3: is no")));
  EXPECT_THAT(read_all(folder_.file("none")).messages, ElementsAre(HasSubstr("no such file")));
}

// A record of 4 GB in a file of 30 bytes.
TEST_F(MessageLogTest, RefusesLengthsBeyondTheFile) {
  const std::string bag = "#ROSBAG V2.0\n" + std::string("\xff\xff\xff\xff", 4);
  EXPECT_THAT(read("a.bag", bag).messages, ElementsAre(HasSubstr("ends before its header")));
  const std::string mcap("\x89MCAP0\r\n\x06\xff\xff\xff\xff\xff\xff\xff\x7f", 17);
  const Read cut = read("a.mcap", mcap);
  EXPECT_THAT(cut.messages, IsEmpty());
  EXPECT_THAT(cut.remarks, ElementsAre(HasSubstr("of 17 bytes the first 8 are complete")));
}

std::string zstd(const std::string& text) {
  std::string out(ZSTD_compressBound(text.size()), '\0');
  out.resize(ZSTD_compress(out.data(), out.size(), text.data(), text.size(), 1));
  return out;
}

std::string lz4(const std::string& text) {
  std::string out(LZ4F_compressFrameBound(text.size(), nullptr), '\0');
  out.resize(LZ4F_compressFrame(out.data(), out.size(), text.data(), text.size(), nullptr));
  return out;
}

class ChunkCodecTest : public testing::Test {
 protected:
  Expected<void> unpack(const std::string& codec, const std::string& packed, std::uint64_t size) {
    return unpack_chunk(codec, bytes_of(packed), size, budget_, out_);
  }
  UnpackBudget budget_{0};
  std::vector<std::byte> out_;
  const std::string text_ = std::string(300'000, 'a') + "end";
};

TEST_F(ChunkCodecTest, RefusesSizesThatAreWrongOrTooLarge) {
  EXPECT_FALSE(unpack("zstd", zstd(text_), std::uint64_t{1} << 40));
  EXPECT_TRUE(out_.empty()) << "refused before it is unpacked";
  EXPECT_THAT(error_of(unpack("zstd", zstd(text_), text_.size() + 1)),
              HasSubstr("unpacks to 300003 bytes, not to 300004"));
  EXPECT_FALSE(unpack("lz4", lz4(text_), 100));
  EXPECT_LE(out_.size(), 65536u) << "little more than the stated size is unpacked";
  EXPECT_TRUE(unpack("zstd", zstd(text_) + "padding", text_.size()));
}

TEST_F(ChunkCodecTest, UnpacksNoMoreThanTheLargestChunk) {
  EXPECT_THAT(error_of(unpack("zstd", zstd(text_), kLargestChunk_bytes + 1)),
              HasSubstr("is larger than 128 MiB: write the file again with smaller chunks"));
  EXPECT_TRUE(out_.empty()) << "refused before it is unpacked";
  const std::string bomb = zstd(std::string(kLargestChunk_bytes + 1, '\0'));
  EXPECT_LT(bomb.size(), kLargestChunk_bytes / 1000);
  EXPECT_THAT(error_of(unpack("zstd", bomb, 0)), HasSubstr("is larger than 128 MiB"));
  EXPECT_LE(out_.capacity(), kLargestChunk_bytes + 1);
}

TEST_F(ChunkCodecTest, RefusesTruncatedAndDamagedChunks) {
  for (const auto& [name, packed] :
       {std::pair("zstd", zstd(text_)), std::pair("lz4", lz4(text_))}) {
    EXPECT_FALSE(unpack(name, packed.substr(0, packed.size() - 5), text_.size())) << name;
    EXPECT_FALSE(unpack(name, "no such thing", text_.size())) << name;
  }
  EXPECT_FALSE(unpack("bz2", "BZh9 and no more", text_.size()));
  EXPECT_FALSE(unpack("lzma", "x", 1));
}

TEST_F(ChunkCodecTest, AFileUnpacksToNoMoreThanItsBudget) {
  EXPECT_EQ(UnpackBudget(1000).left(), UnpackBudget::kAlways_bytes + 250'000);
  EXPECT_GT(UnpackBudget(~std::uint64_t{0}).left(), std::uint64_t{1} << 57);
  for (const auto& [name, packed] :
       {std::pair("zstd", zstd(text_)), std::pair("lz4", lz4(text_))}) {
    budget_ = UnpackBudget(0);
    budget_.spend(budget_.left() - text_.size());
    EXPECT_TRUE(unpack(name, packed, text_.size())) << name;
    EXPECT_EQ(budget_.left(), 0u);
    EXPECT_THAT(error_of(unpack(name, packed, text_.size())), HasSubstr("250 times its size"));
  }
}

std::string mcap_of(char op, const std::string& content) {
  std::string length(8, '\0');
  for (std::size_t i = 0; i < 8; ++i) length[i] = static_cast<char>(content.size() >> (8 * i));
  return op + length + content;
}

std::string chunk_of(const std::string& records) {
  const std::string size = mcap_of(0, records).substr(1, 8);
  return mcap_of(6, std::string(16, '\0') + size + std::string(8, '\0') + size + records);
}

// It could contain itself, and be unpacked without end.
TEST_F(MessageLogTest, OpensNoChunkInAChunk) {
  const std::string schema = mcap_of(3, std::string("\1\0\1\0\0\0x\0\0\0\0\0\0\0\0", 15));
  const std::string channel = mcap_of(4, std::string("\1\0\1\0\2\0\0\0/a\3\0\0\0cdr\0\0\0\0", 21));
  const std::string message = mcap_of(5, std::string("\1\0", 2) + std::string(20, '\0') + "m");
  const std::string records = schema + channel + message;
  const std::string magic = "\x89MCAP0\r\n";
  EXPECT_THAT(read("a.mcap", magic + chunk_of(records)).messages, ElementsAre("/a x 0 m"));
  const Read nested = read("b.mcap", magic + chunk_of(records + chunk_of(records)));
  EXPECT_THAT(nested.messages, ElementsAre("/a x 0 m"));
  EXPECT_THAT(nested.remarks, testing::Contains(HasSubstr("a chunk contains a chunk")));
}

// A chunk of zeros would be read as millions of empty records.
TEST_F(MessageLogTest, LeavesOutAChunkOfZeros) {
  const Read zeros = read("a.mcap", "\x89MCAP0\r\n" + chunk_of(std::string(900, '\0')));
  EXPECT_THAT(zeros.remarks, testing::Contains(HasSubstr("a record in a chunk is broken")));
}

// What follows it is read: such a file is not truncated.
TEST_F(MessageLogTest, LeavesOutARecordThatIsTooLarge) {
  const auto with_large_record = [&](const std::string& name, std::string before,
                                     const std::string& after) {
    const std::string path = folder_.write(name, before);
    std::filesystem::resize_file(path, before.size() + kLargestChunk_bytes + 1);
    std::ofstream(path, std::ios::binary | std::ios::app) << after;
    return read_all(path);
  };
  const std::string mcap = mcap_file(kMessages, {"zstd"});
  const std::string large("\x06\x01\0\0\x08\0\0\0\0", 9);
  const Read of_mcap = with_large_record("a.mcap", mcap.substr(0, 8) + large, mcap.substr(8));
  EXPECT_THAT(of_mcap.messages, kAll);
  EXPECT_THAT(of_mcap.remarks, testing::Contains(HasSubstr("a record is larger than 128 MiB")));
  const std::string bag = bag_file(kMessages, {"lz4"});
  const std::string head("\x08\0\0\0\x04\0\0\0op=\x05\x01\0\0\x08", 16);
  const std::size_t first = 4096;  // the magic and the record of the bag's header
  const Read of_bag = with_large_record("a.bag", bag.substr(0, first) + head, bag.substr(first));
  EXPECT_THAT(of_bag.messages, kAll);
  EXPECT_THAT(of_bag.remarks, testing::Contains(HasSubstr("a record is larger than 128 MiB")));
}

class Db3Test : public testing::Test {
 protected:
  void run(const std::string& sql) {
    sqlite3* file = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &file), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(file, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sql;
    sqlite3_close(file);
  }
  TemporaryFolder folder_;
  const std::string path_ = folder_.file("a.db3");
};

TEST_F(Db3Test, RunsNoGeneratedColumn) {
  for (const char* kind : {"VIRTUAL", "STORED"}) {
    std::filesystem::remove(path_);
    run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format);"
        "INSERT INTO topics VALUES(1, '/imu0', 'sensor_msgs/msg/Imu', 'cdr');"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(1000)) " +
        std::string(kind) + "); INSERT INTO messages(topic_id, timestamp) VALUES(1, 5);");
    EXPECT_THAT(read_all(path_).messages, ElementsAre(HasSubstr("compute columns"))) << kind;
  }
}

TEST_F(Db3Test, RunsNoView) {
  test::write_db3(path_, kMessages);
  run("ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS SELECT * FROM m;");
  EXPECT_THAT(read_all(path_).messages, ElementsAre(HasSubstr("no tables 'topics'")));
}

// A literal default is not stored in the rows.
TEST_F(Db3Test, GivesNoMoreBytesThanTheFileHas) {
  test::write_db3(path_, kMessages);
  run("CREATE TABLE n(id INTEGER PRIMARY KEY, topic_id, timestamp);"
      "INSERT INTO n SELECT id, topic_id, timestamp FROM messages; DROP TABLE messages;"
      "ALTER TABLE n ADD COLUMN data DEFAULT '" +
      std::string(20'000, 'x') + "'; ALTER TABLE n RENAME TO messages;");
  const Read log = read_all(path_);
  EXPECT_LT(log.messages.size(), kMessages.size());
  EXPECT_THAT(log.remarks, ElementsAre(HasSubstr("more bytes than the file")));
}

// Twenty levels of such pages would give more rows than can be read in a life.
TEST_F(Db3Test, ReadsEachRowOnce) {
  test::write_db3(path_, std::vector<StoredMessage>(2000, kMessages.front()));
  ASSERT_EQ(read_all(path_).messages.size(), 2000u);
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  std::string bytes(std::filesystem::file_size(path_), '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  constexpr std::size_t kPage = 4096;
  const auto number = [&](std::size_t at) {
    return static_cast<unsigned char>(bytes[at]) * 256U + static_cast<unsigned char>(bytes[at + 1]);
  };
  bool is_changed = false;
  for (std::size_t page = kPage; page < bytes.size(); page += kPage) {
    if (bytes[page] != 5) continue;  // a table's page with links
    for (std::size_t cell = 1; cell < number(page + 3); ++cell)
      bytes.replace(page + number(page + 12 + 2 * cell), 4, bytes, page + number(page + 12), 4);
    is_changed = true;
  }
  ASSERT_TRUE(is_changed);
  file.seekp(0);
  file << bytes << std::flush;
  const Read log = read_all(path_);
  EXPECT_LT(log.messages.size(), 2000u);
  EXPECT_THAT(log.remarks, ElementsAre(HasSubstr("its rows repeat")));
}

}  // namespace
}  // namespace fiducap
