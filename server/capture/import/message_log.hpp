#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

enum class MessageFormat {
  kRos1,  ///< ROS 1: packed, little endian.
  kCdr,   ///< ROS 2: CDR with its encapsulation header.
  kOther
};

/// More topics are ignored.
inline constexpr std::size_t kMostTopics = 4096;

struct LoggedTopic {
  std::string name;
  std::string type;  ///< As in ROS 1: `sensor_msgs/Imu`.
  MessageFormat format{MessageFormat::kOther};
};

struct LoggedMessage {
  std::size_t topic{};               ///< Index in MessageLog::topics().
  std::int64_t logged_ns{};          ///< When the recorder got it.
  std::span<const std::byte> bytes;  ///< Until the next call.
};

/// A file of messages in recorded order. Omits damaged parts and a cut end; remarks report them.
class MessageLog {
 public:
  virtual ~MessageLog() = default;
  /// Those met so far, in order of appearance.
  [[nodiscard]] const std::vector<LoggedTopic>& topics() const { return topics_; }
  /// @return false at the end; Error when the file cannot be read any more
  [[nodiscard]] virtual Expected<bool> next(LoggedMessage& out) = 0;
  /// Progress, 0 to 1.
  [[nodiscard]] virtual double share() const = 0;
  /// Remarks for the user, complete at the end of the file.
  [[nodiscard]] virtual std::vector<std::string> remarks() const = 0;

 protected:
  /// @return index of this topic; publishers of the same topic share it
  std::size_t index_of(LoggedTopic topic);

  std::vector<LoggedTopic> topics_;
};

/// A bag, an MCAP file, an SQLite file of rosbag2, or a folder of the latter two, by its content.
/// @return Error that names the expected formats
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_message_log(const std::string& path);

/// A bag of ROS 1, format 2.0, packed by none, bz2 or lz4. Its index is not used.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_bag(const std::string& path);
/// An MCAP file, profiles ros1 and ros2, packed by none, lz4 or zstd. Tests checksums if present.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_mcap(const std::string& path);
/// One SQLite file of rosbag2, read-only; a damaged one is read up to there.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_db3(const std::string& path);
/// Several of them as one, in the order of their first messages: parts of one recording, or its
/// camera and its IMU by two recorders.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_message_logs(
    const std::vector<std::string>& paths);
/// A folder of rosbag2: its files in the order of `metadata.yaml`; without it all logs in it.
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_rosbag2_folder(const std::string& path);

/// `sensor_msgs/msg/Imu` → `sensor_msgs/Imu`.
[[nodiscard]] std::string plain_type(const std::string& type);

/// `printable`, of at most 200 bytes.
[[nodiscard]] std::string printable_name(std::string_view text);

/// Largest chunk or message that is read. Recorders end a chunk at 0.8 to 4 MiB, so a larger one
/// has one message; an image of 65 megapixels with 16 bits has 124 MiB.
inline constexpr std::uint64_t kLargestChunk_bytes = std::uint64_t{1} << 27;
inline constexpr const char* kChunkTooLarge =
    "is larger than 128 MiB: write the file again with smaller chunks (`mcap compress`, `rosbag "
    "compress`)";

/// Bytes that a file may unpack to in total. Images and IMU readings shrink to a tenth at best;
/// content that was made to take time and memory shrinks to a thirty-thousandth.
class UnpackBudget final {
 public:
  static constexpr std::uint64_t kPerByte = 250;
  static constexpr std::uint64_t kAlways_bytes = std::uint64_t{1} << 28;

  explicit UnpackBudget(std::uint64_t file_bytes)
      : left_(kAlways_bytes + kPerByte * std::min(file_bytes, kLargestFile_bytes)) {}
  [[nodiscard]] std::uint64_t left() const { return left_; }
  void spend(std::uint64_t bytes) { left_ -= std::min(left_, bytes); }

 private:
  static constexpr std::uint64_t kLargestFile_bytes = std::uint64_t{1} << 50;  // no overflow

  std::uint64_t left_;
};

/// Unpacks a chunk or message: `none` (or empty), `bz2`, `lz4` (frames, as ROS and MCAP write
/// them), `zstd`. Memory grows with the actual content, at most to the stated size.
/// @param stated_bytes  size of the content according to the file; 0: not known
/// @param budget  of the file
/// @return Error when it is damaged, has another size than stated, or the budget is spent
[[nodiscard]] Expected<void> unpack_chunk(std::string_view compression,
                                          std::span<const std::byte> packed,
                                          std::uint64_t stated_bytes, UnpackBudget& budget,
                                          std::vector<std::byte>& out);

}  // namespace fiducap
