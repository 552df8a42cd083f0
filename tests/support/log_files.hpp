#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace fiducap::test {

/// A message to be stored.
struct StoredMessage {
  std::string topic;
  std::string type;  ///< `sensor_msgs/Imu`
  std::int64_t logged_ns{};
  std::string bytes;
};

struct LogFileOptions {
  std::string compression{"none"};  ///< Of chunks: none, bz2 (bags), lz4, zstd (MCAP).
  std::size_t messages_per_chunk{3};
  bool closed{true};      ///< With an index or a summary and its end.
  bool ros2{false};       ///< MCAP: profile ros2, messages in CDR.
  bool wrong_crc{false};  ///< MCAP: of the first chunk.
  bool nested{false};     ///< Bag: each chunk in another one, as only hostile files have it.
};

/// Files as recorders write them, made from the specifications of their formats.
[[nodiscard]] std::string bag_file(const std::vector<StoredMessage>& messages,
                                   const LogFileOptions& options = {});
[[nodiscard]] std::string mcap_file(const std::vector<StoredMessage>& messages,
                                    const LogFileOptions& options = {});
/// An SQLite file of rosbag2 at `path`.
void write_db3(const std::string& path, const std::vector<StoredMessage>& messages);

/// A file in an archive.
struct StoredFile {
  std::string name;
  std::string content;
  bool deflated{true};
  bool zip64{false};  ///< Sizes where those beyond 4 GB stand, as phones write them.
};
[[nodiscard]] std::string zip_file(const std::vector<StoredFile>& files);

}  // namespace fiducap::test
