#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// How the bytes of a message are laid out.
enum class MessageFormat {
  kRos1,  ///< ROS 1: packed, little endian.
  kCdr,   ///< ROS 2: CDR with its encapsulation header.
  kOther
};

/// More are not met: no robot has so many.
inline constexpr std::size_t kMostTopics = 4096;

struct LoggedTopic {
  std::string name;
  std::string type;  ///< As ROS 1 writes it: `sensor_msgs/Imu`.
  MessageFormat format{MessageFormat::kOther};
};

struct LoggedMessage {
  std::size_t topic{};               ///< Index in MessageLog::topics().
  std::int64_t logged_ns{};          ///< When the recorder got it.
  std::span<const std::byte> bytes;  ///< Until the next call.
};

/// Messages in the order in which a recorder wrote them, whatever the file. What is damaged is left
/// out and remarked; where the file is cut, reading ends, and that is remarked.
class MessageLog {
 public:
  virtual ~MessageLog() = default;
  /// Those met so far, in order of appearance.
  [[nodiscard]] virtual const std::vector<LoggedTopic>& topics() const = 0;
  /// @return false at the end; Error when the file cannot be read any more
  [[nodiscard]] virtual Expected<bool> next(LoggedMessage& out) = 0;
  /// How much is read, 0 to 1.
  [[nodiscard]] virtual double share() const = 0;
  /// What a person should know about the file, complete at its end.
  [[nodiscard]] virtual std::vector<std::string> remarks() const = 0;
};

/// `sensor_msgs/msg/Imu` → `sensor_msgs/Imu`.
[[nodiscard]] std::string plain_type(const std::string& type);

/// Text from outside, fit for a message: printable, not longer than 200 characters.
[[nodiscard]] std::string printable_name(std::string_view text);

/// A bag, an MCAP file, an SQLite file of rosbag2, or a folder of the latter two, by its content.
/// @return Error saying what it is instead
[[nodiscard]] Expected<std::unique_ptr<MessageLog>> open_message_log(const std::string& path);

}  // namespace fiducap
