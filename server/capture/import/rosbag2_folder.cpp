#include "capture/import/rosbag2_folder.hpp"

#include <algorithm>
#include <filesystem>

#include "base/yaml_section.hpp"
#include "capture/import/chunk_codec.hpp"
#include "capture/import/db3_log.hpp"
#include "capture/import/mcap_log.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

struct Rosbag2Parts {
  std::vector<std::filesystem::path> files;
  bool messages_packed{false};
  std::vector<std::string> remarks;
};

class Rosbag2Folder final : public MessageLog {
 public:
  explicit Rosbag2Folder(Rosbag2Parts parts) : parts_(std::move(parts)) {}

  Expected<void> begin() { return open_part(); }
  const std::vector<LoggedTopic>& topics() const override { return topics_; }
  Expected<bool> next(LoggedMessage& out) override;
  double share() const override {
    const double whole = static_cast<double>(parts_.files.size());
    return (static_cast<double>(part_) + (log_ ? log_->share() : 0.0)) / whole;
  }
  std::vector<std::string> remarks() const override;

 private:
  Expected<void> open_part();
  std::size_t topic_of(std::size_t in_part);
  void keep_remarks();

  Rosbag2Parts parts_;
  std::size_t part_{0};
  std::unique_ptr<MessageLog> log_;
  std::vector<LoggedTopic> topics_;
  std::vector<std::size_t> of_part_;  ///< Topic of the open file → ours.
  std::vector<std::byte> unpacked_;
  std::uint64_t damaged_{0};
};

Expected<void> Rosbag2Folder::open_part() {
  const std::string path = parts_.files[part_].string();
  auto log = path.ends_with(".mcap") ? open_mcap(path) : open_db3(path);
  if (!log) return tl::unexpected(log.error());
  log_ = std::move(*log);
  of_part_.clear();
  return {};
}

std::size_t Rosbag2Folder::topic_of(std::size_t in_part) {
  while (of_part_.size() <= in_part) {
    const LoggedTopic& topic = log_->topics()[of_part_.size()];
    const auto known = std::find_if(topics_.begin(), topics_.end(), [&](const LoggedTopic& t) {
      return t.name == topic.name && t.type == topic.type;
    });
    of_part_.push_back(static_cast<std::size_t>(known - topics_.begin()));
    if (known == topics_.end()) topics_.push_back(topic);
  }
  return of_part_[in_part];
}

void Rosbag2Folder::keep_remarks() {
  for (const std::string& remark : log_->remarks())
    parts_.remarks.push_back(parts_.files[part_].filename().string() + " " + remark);
  log_.reset();
}

Expected<bool> Rosbag2Folder::next(LoggedMessage& out) {
  while (log_) {
    const auto more = log_->next(out);
    if (!more) return more;
    if (!*more) {
      keep_remarks();
      if (++part_ == parts_.files.size()) return false;
      if (const auto opened = open_part(); !opened) return tl::unexpected(opened.error());
      continue;
    }
    out.topic = topic_of(out.topic);
    if (!parts_.messages_packed) return true;
    if (unpack_chunk("zstd", out.bytes, 0, unpacked_)) {
      out.bytes = unpacked_;
      return true;
    }
    ++damaged_;
  }
  return false;
}

std::vector<std::string> Rosbag2Folder::remarks() const {
  std::vector<std::string> all = parts_.remarks;
  if (damaged_ > 0)
    all.push_back("has " + std::to_string(damaged_) + " messages that cannot be unpacked");
  return all;
}

bool is_part(const std::filesystem::path& file) {
  return file.extension() == ".db3" || file.extension() == ".mcap";
}

Expected<Rosbag2Parts> parts_by_name(const std::filesystem::path& folder) {
  Rosbag2Parts parts;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (is_part(entry.path()) && is_file(entry.path())) parts.files.push_back(entry.path());
  if (error)
    return fail(ErrorCode::kUnavailable, "cannot be read: " + error.message(), folder.string());
  std::sort(parts.files.begin(), parts.files.end());
  parts.remarks.emplace_back("has no metadata.yaml: its files were read in order of their names");
  return parts;
}

Expected<Rosbag2Parts> parts_by_metadata(const std::filesystem::path& folder) {
  const auto yaml = YamlSection::load(folder / "metadata.yaml");
  if (!yaml) return tl::unexpected(yaml.error());
  const YamlSection bag = yaml->section("rosbag2_bagfile_information");
  std::vector<std::string> names;
  bag.read("relative_file_paths", names);
  const std::string packing = bag.text("compression_format").value_or("");
  const std::string mode = bag.text("compression_mode").value_or("");
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  Rosbag2Parts parts;
  parts.messages_packed = mode == "MESSAGE" || mode == "message";
  if (parts.messages_packed && packing != "zstd")
    return fail(ErrorCode::kUnsupported,
                "its messages are packed by '" + printable_name(packing) + "'; known is zstd",
                folder.string());
  for (const std::string& name : names) {
    // Older recorders wrote the folder's name before it; nothing outside of the folder is opened.
    const std::filesystem::path file = folder / std::filesystem::path(name).filename();
    if (file.extension() == ".zstd")
      return fail(ErrorCode::kUnsupported,
                  "is packed as a whole: unpack it (zstd -d --rm " + file.filename().string() +
                      ") and strike .zstd and the compression keys from metadata.yaml",
                  file.string());
    if (is_file(file))
      parts.files.push_back(file);
    else
      parts.remarks.push_back("lacks " + printable_name(name) + ", which metadata.yaml names");
  }
  return parts;
}

}  // namespace

Expected<std::unique_ptr<MessageLog>> open_rosbag2_folder(const std::string& path) {
  auto parts = is_file(std::filesystem::path(path) / "metadata.yaml") ? parts_by_metadata(path)
                                                                      : parts_by_name(path);
  if (!parts) return tl::unexpected(parts.error());
  if (parts->files.empty())
    return fail(ErrorCode::kNotFound, "holds no file of rosbag2 (.db3, .mcap)", path);
  auto folder = std::make_unique<Rosbag2Folder>(std::move(*parts));
  if (const auto begun = folder->begin(); !begun) return tl::unexpected(begun.error());
  return folder;
}

}  // namespace fiducap
