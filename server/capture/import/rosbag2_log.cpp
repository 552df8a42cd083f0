#include <algorithm>
#include <filesystem>
#include <map>

#include <sqlite3.h>

#include "base/yaml_section.hpp"
#include "capture/import/message_log.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {
namespace {

struct CloseDb3 {
  void operator()(sqlite3* file) const { sqlite3_close_v2(file); }
  void operator()(sqlite3_stmt* rows) const { sqlite3_finalize(rows); }
};
using Db3Rows = std::unique_ptr<sqlite3_stmt, CloseDb3>;

class Db3Log final : public MessageLog {
 public:
  explicit Db3Log(std::string path) : path_(std::move(path)) {}

  Expected<void> begin() {
    if (const auto opened = open(); !opened) return opened;
    if (const auto there = require_tables(); !there) return there;
    if (const auto read = read_topics(); !read) return read;
    if (const Db3Rows last = prepare("SELECT max(rowid) FROM messages");
        last && sqlite3_step(last.get()) == SQLITE_ROW)
      last_row_ = sqlite3_column_int64(last.get(), 0);
    // In recorded order, without sorting.
    messages_ = prepare("SELECT topic_id, timestamp, data, rowid FROM messages NOT INDEXED");
    if (!messages_)
      return fail(ErrorCode::kInvalid, "its table 'messages' is not that of rosbag2", path_);
    return {};
  }

  Expected<bool> next(LoggedMessage& out) override {
    for (;;) {
      steps_ = 0;
      const int code = failure_.empty() ? sqlite3_step(messages_.get()) : SQLITE_DONE;
      if (code != SQLITE_ROW) {
        if (code != SQLITE_DONE) failure_ = sqlite3_errmsg(file_.get());
        return false;
      }
      const std::int64_t row = sqlite3_column_int64(messages_.get(), 3);
      given_bytes_ += static_cast<std::uint64_t>(sqlite3_column_bytes(messages_.get(), 2));
      // Pages that are linked twice would give rows without end.
      if (is_begun_ && row <= row_) failure_ = "its rows repeat";
      if (given_bytes_ > file_bytes_) failure_ = "its rows have more bytes than the file";
      if (!failure_.empty()) return false;
      is_begun_ = true;
      row_ = row;
      const auto topic = by_id_.find(sqlite3_column_int64(messages_.get(), 0));
      if (topic == by_id_.end()) {
        ++lost_;
        continue;
      }
      const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(messages_.get(), 2));
      const auto size = static_cast<std::size_t>(sqlite3_column_bytes(messages_.get(), 2));
      out = {topic->second, sqlite3_column_int64(messages_.get(), 1), {data, data ? size : 0}};
      return true;
    }
  }

  double share() const override {
    return last_row_ > 0 ? static_cast<double>(row_) / static_cast<double>(last_row_) : 0.0;
  }

  std::vector<std::string> remarks() const override {
    std::vector<std::string> all;
    if (!failure_.empty())
      all.push_back("is damaged after row " + std::to_string(row_) + " of " +
                    std::to_string(last_row_) + " (" + failure_ + "): read up to there");
    if (lost_ > 0) all.push_back("has " + std::to_string(lost_) + " messages of no topic");
    return all;
  }

 private:
  Expected<void> open() {
    sqlite3* file = nullptr;
    const int code = sqlite3_open_v2(path_.c_str(), &file, SQLITE_OPEN_READONLY, nullptr);
    file_.reset(file);
    if (code != SQLITE_OK) return fail(ErrorCode::kUnavailable, "cannot be opened", path_);
    for (const char* part : {"", "-wal"}) {
      std::error_code missing;
      const auto bytes = std::filesystem::file_size(path_ + part, missing);
      if (!missing) file_bytes_ += bytes;
    }
    // Runs nothing that the file defines, and limits steps without a row, and sizes to that of a
    // message.
    sqlite3_progress_handler(
        file, kStepsAtOnce,
        [](void* steps) { return ++*static_cast<int*>(steps) > kMostSteps ? 1 : 0; }, &steps_);
    sqlite3_db_config(file, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(file, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_limit(file, SQLITE_LIMIT_LENGTH, static_cast<int>(kLargestChunk_bytes));
    return {};
  }

  /// Plain tables with plain columns: views, virtual tables and generated columns could compute
  /// without end.
  Expected<void> require_tables() const {
    const Db3Rows computed = prepare(
        "SELECT count(*) FROM sqlite_master AS t JOIN pragma_table_xinfo(t.name) AS c "
        "WHERE t.name IN ('topics', 'messages') AND c.hidden <> 0");
    if (computed && sqlite3_step(computed.get()) == SQLITE_ROW &&
        sqlite3_column_int(computed.get(), 0) > 0)
      return fail(ErrorCode::kInvalid,
                  "is no recording of rosbag2: its tables compute columns, which is not run",
                  path_);
    const Db3Rows rows = prepare(
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND rootpage > 0 AND name IN "
        "('topics', 'messages')");
    if (!rows || sqlite3_step(rows.get()) != SQLITE_ROW)
      return fail(ErrorCode::kInvalid,
                  std::string("is no readable SQLite file: ") + sqlite3_errmsg(file_.get()), path_);
    if (sqlite3_column_int(rows.get(), 0) == 2) return {};
    return fail(ErrorCode::kInvalid,
                "is no recording of rosbag2: it has no tables 'topics' and 'messages'", path_);
  }

  Expected<void> read_topics() {
    const Db3Rows rows = prepare("SELECT id, name, type, serialization_format FROM topics");
    if (!rows) return fail(ErrorCode::kInvalid, "its table 'topics' is not that of rosbag2", path_);
    while (sqlite3_step(rows.get()) == SQLITE_ROW && topics_.size() < kMostTopics) {
      by_id_[sqlite3_column_int64(rows.get(), 0)] = topics_.size();
      const bool cdr = text(rows.get(), 3) == "cdr";
      topics_.push_back({text(rows.get(), 1), plain_type(text(rows.get(), 2)),
                         cdr ? MessageFormat::kCdr : MessageFormat::kOther});
    }
    return {};
  }

  Db3Rows prepare(const char* sql) const {
    sqlite3_stmt* rows = nullptr;
    sqlite3_prepare_v2(file_.get(), sql, -1, &rows, nullptr);
    return Db3Rows(rows);
  }

  [[nodiscard]] std::string text(sqlite3_stmt* rows, int column) const {
    const auto* begin = reinterpret_cast<const char*>(sqlite3_column_text(rows, column));
    return begin == nullptr
               ? std::string()
               : std::string(begin, static_cast<std::size_t>(sqlite3_column_bytes(rows, column)));
  }

  static constexpr int kStepsAtOnce = 1000;  // of SQLite's machine
  static constexpr int kMostSteps = 100'000;

  std::string path_;
  int steps_{0};  ///< Of kStepsAtOnce, since the last row.
  std::unique_ptr<sqlite3, CloseDb3> file_;
  Db3Rows messages_;
  std::map<std::int64_t, std::size_t> by_id_;
  std::int64_t row_{0};
  std::int64_t last_row_{0};
  bool is_begun_{false};
  std::uint64_t file_bytes_{0};
  std::uint64_t given_bytes_{0};
  std::uint64_t lost_{0};
  std::string failure_;
};

struct LogParts {
  std::vector<std::filesystem::path> files;
  bool messages_packed{false};
  std::vector<std::string> remarks;
};

/// Several files as one log.
class JoinedLog final : public MessageLog {
 public:
  explicit JoinedLog(LogParts parts) : parts_(std::move(parts)), budget_(size_of(parts_.files)) {}

  Expected<void> begin() { return open_part(); }

  Expected<bool> next(LoggedMessage& out) override {
    while (log_) {
      const auto more = log_->next(out);
      if (!more) return more;
      if (!*more) {
        for (const std::string& remark : log_->remarks())
          parts_.remarks.push_back(parts_.files[part_].filename().string() + " " + remark);
        log_.reset();
        if (++part_ == parts_.files.size()) return false;
        if (const auto opened = open_part(); !opened) return tl::unexpected(opened.error());
        continue;
      }
      while (of_part_.size() <= out.topic)
        of_part_.push_back(index_of(log_->topics()[of_part_.size()]));
      out.topic = of_part_[out.topic];
      if (!parts_.messages_packed) return true;
      if (unpack_chunk("zstd", out.bytes, 0, budget_, unpacked_)) {
        out.bytes = unpacked_;
        return true;
      }
      ++damaged_;
    }
    return false;
  }

  double share() const override {
    const double whole = static_cast<double>(parts_.files.size());
    return (static_cast<double>(part_) + (log_ ? log_->share() : 0.0)) / whole;
  }

  std::vector<std::string> remarks() const override {
    std::vector<std::string> all = parts_.remarks;
    if (damaged_ > 0)
      all.push_back("has " + std::to_string(damaged_) + " messages that cannot be unpacked");
    return all;
  }

 private:
  Expected<void> open_part() {
    const std::string path = parts_.files[part_].string();
    auto log = open_message_log(path);
    if (!log) return tl::unexpected(log.error());
    log_ = std::move(*log);
    of_part_.clear();
    return {};
  }

  static std::uint64_t size_of(const std::vector<std::filesystem::path>& files) {
    std::uint64_t sum = 0;
    for (const auto& file : files) {
      std::error_code missing;
      const auto bytes = std::filesystem::file_size(file, missing);
      if (!missing) sum += bytes;
    }
    return sum;
  }

  LogParts parts_;
  UnpackBudget budget_;
  std::size_t part_{0};
  std::unique_ptr<MessageLog> log_;
  std::vector<std::size_t> of_part_;  ///< Our topic for each of the open file.
  std::vector<std::byte> unpacked_;
  std::uint64_t damaged_{0};
};

/// In the order of their first messages: names of parts do not sort by time (_10 before _2).
Expected<void> sort_by_time(LogParts& parts) {
  std::vector<std::pair<std::int64_t, std::filesystem::path>> begins;
  for (const auto& file : parts.files) {
    const auto log = open_message_log(file.string());
    if (!log) return tl::unexpected(log.error());
    LoggedMessage first;
    const auto any = (*log)->next(first);
    begins.emplace_back(any && *any ? first.logged_ns : 0, file);
  }
  std::ranges::sort(begins);
  for (std::size_t i = 0; i < begins.size(); ++i) parts.files[i] = begins[i].second;
  return {};
}

Expected<LogParts> parts_of_folder(const std::filesystem::path& folder) {
  LogParts parts;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    std::string ending = entry.path().extension().string();
    if (ending == ".active")
      ending = entry.path().stem().extension().string();  // of a killed recorder
    const bool is_log = ending == ".db3" || ending == ".mcap" || ending == ".bag";
    if (is_log ? is_file(entry.path()) : is_file(entry.path() / "metadata.yaml"))
      parts.files.push_back(entry.path());
  }
  if (error)
    return fail(ErrorCode::kUnavailable, "cannot be read: " + error.message(), folder.string());
  if (parts.files.empty())
    return fail(ErrorCode::kNotFound, "contains no log of ROS (.bag, .db3, .mcap)",
                folder.string());
  if (const auto sorted = sort_by_time(parts); !sorted) return tl::unexpected(sorted.error());
  parts.remarks.push_back("has no metadata.yaml: its " + std::to_string(parts.files.size()) +
                          " files are read as one recording");
  return parts;
}

Expected<LogParts> parts_by_metadata(const std::filesystem::path& folder) {
  const auto yaml = YamlSection::load(folder / "metadata.yaml");
  if (!yaml) return tl::unexpected(yaml.error());
  const YamlSection bag = yaml->section("rosbag2_bagfile_information");
  std::vector<std::string> names;
  bag.read("relative_file_paths", names);
  const std::string packing = bag.text("compression_format").value_or("");
  const std::string mode = bag.text("compression_mode").value_or("");
  if (const auto sound = yaml->check(); !sound) return tl::unexpected(sound.error());
  LogParts parts;
  parts.messages_packed = mode == "MESSAGE" || mode == "message";
  if (parts.messages_packed && packing != "zstd")
    return fail(ErrorCode::kUnsupported,
                "its messages are packed by '" + printable_name(packing) + "'; supported is zstd",
                folder.string());
  for (const std::string& name : names) {
    // Older recorders include the folder's name; nothing outside of the folder is opened.
    const std::filesystem::path file = folder / std::filesystem::path(name).filename();
    if (file.extension() == ".zstd")
      return fail(ErrorCode::kUnsupported,
                  "is packed as a whole: unpack it (zstd -d --rm " + file.filename().string() +
                      ") and remove .zstd and the compression keys from metadata.yaml",
                  file.string());
    if (is_file(file))
      parts.files.push_back(file);
    else
      parts.remarks.push_back("lacks " + printable_name(name) + ", which metadata.yaml lists");
  }
  return parts;
}

}  // namespace

Expected<std::unique_ptr<MessageLog>> open_db3(const std::string& path) {
  auto log = std::make_unique<Db3Log>(path);
  return log->begin().map([&] { return std::move(log); });
}

Expected<std::unique_ptr<MessageLog>> open_rosbag2_folder(const std::string& path) {
  auto parts = is_file(std::filesystem::path(path) / "metadata.yaml") ? parts_by_metadata(path)
                                                                      : parts_of_folder(path);
  if (!parts) return tl::unexpected(parts.error());
  if (parts->files.empty())
    return fail(ErrorCode::kNotFound, "contains no file of rosbag2 (.db3, .mcap)", path);
  auto folder = std::make_unique<JoinedLog>(std::move(*parts));
  return folder->begin().map([&] { return std::move(folder); });
}

Expected<std::unique_ptr<MessageLog>> open_message_logs(const std::vector<std::string>& paths) {
  if (paths.size() == 1) return open_message_log(paths.front());
  LogParts parts;
  parts.files.assign(paths.begin(), paths.end());
  if (const auto sorted = sort_by_time(parts); !sorted) return tl::unexpected(sorted.error());
  auto joined = std::make_unique<JoinedLog>(std::move(parts));
  return joined->begin().map([&] { return std::move(joined); });
}

}  // namespace fiducap
