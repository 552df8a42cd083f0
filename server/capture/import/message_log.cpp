#include "capture/import/message_log.hpp"

#include <string_view>

#include "capture/import/bag_log.hpp"
#include "capture/import/db3_log.hpp"
#include "capture/import/input_file.hpp"
#include "capture/import/mcap_log.hpp"
#include "capture/import/rosbag2_folder.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {

std::string plain_type(const std::string& type) {
  constexpr std::string_view kMiddle = "/msg/";
  const std::size_t at = type.find(kMiddle);
  if (at == std::string::npos) return type;
  return type.substr(0, at) + "/" + type.substr(at + kMiddle.size());
}

std::string printable_name(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 200)) out += c >= ' ' && c != 0x7f ? c : '.';
  return out;
}

Expected<std::unique_ptr<MessageLog>> open_message_log(const std::string& path) {
  if (is_folder(path)) return open_rosbag2_folder(path);
  auto file = InputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  std::vector<std::byte> head;
  const bool read = file->read(std::min<std::uint64_t>(file->size(), 16), head);
  const std::string_view begin(reinterpret_cast<const char*>(head.data()), read ? head.size() : 0);
  if (begin.starts_with("#ROSBAG")) return open_bag(path);
  if (begin.starts_with("\x89MCAP")) return open_mcap(path);
  if (begin.starts_with("SQLite format 3")) return open_db3(path);
  return fail(ErrorCode::kUnsupported,
              "is neither a bag of ROS 1, nor MCAP, nor an SQLite file of rosbag2", path);
}

}  // namespace fiducap
