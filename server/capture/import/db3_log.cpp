#include "capture/import/db3_log.hpp"

#include <map>

#include <sqlite3.h>

#include "capture/import/chunk_codec.hpp"

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

  Expected<void> begin();
  const std::vector<LoggedTopic>& topics() const override { return topics_; }
  Expected<bool> next(LoggedMessage& out) override;
  double share() const override {
    return last_row_ > 0 ? static_cast<double>(row_) / static_cast<double>(last_row_) : 0.0;
  }
  std::vector<std::string> remarks() const override;

 private:
  Expected<void> open();
  Expected<void> require_tables() const;
  Expected<void> read_topics();
  Db3Rows prepare(const char* sql) const;
  [[nodiscard]] std::string text(sqlite3_stmt* rows, int column) const;

  std::string path_;
  std::unique_ptr<sqlite3, CloseDb3> file_;
  Db3Rows messages_;
  std::vector<LoggedTopic> topics_;
  std::map<std::int64_t, std::size_t> by_id_;
  std::int64_t row_{0};
  std::int64_t last_row_{0};
  std::uint64_t lost_{0};
  std::string failure_;
};

Db3Rows Db3Log::prepare(const char* sql) const {
  sqlite3_stmt* rows = nullptr;
  sqlite3_prepare_v2(file_.get(), sql, -1, &rows, nullptr);
  return Db3Rows(rows);
}

std::string Db3Log::text(sqlite3_stmt* rows, int column) const {
  const auto* begin = reinterpret_cast<const char*>(sqlite3_column_text(rows, column));
  return begin == nullptr
             ? std::string()
             : std::string(begin, static_cast<std::size_t>(sqlite3_column_bytes(rows, column)));
}

Expected<void> Db3Log::open() {
  sqlite3* file = nullptr;
  const int code = sqlite3_open_v2(path_.c_str(), &file, SQLITE_OPEN_READONLY, nullptr);
  file_.reset(file);
  if (code != SQLITE_OK) return fail(ErrorCode::kUnavailable, "cannot be opened", path_);
  // Nothing that the file itself defines is run, and nothing in it is larger than a message.
  sqlite3_db_config(file, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(file, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_limit(file, SQLITE_LIMIT_LENGTH, static_cast<int>(kLargestChunk_bytes));
  return {};
}

/// Plain tables: a view or a virtual table of that name could compute for ever.
Expected<void> Db3Log::require_tables() const {
  const Db3Rows rows = prepare(
      "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND rootpage > 0 AND name IN "
      "('topics', 'messages')");
  if (!rows || sqlite3_step(rows.get()) != SQLITE_ROW)
    return fail(ErrorCode::kInvalid,
                std::string("is no SQLite file that can be read: ") + sqlite3_errmsg(file_.get()),
                path_);
  if (sqlite3_column_int(rows.get(), 0) == 2) return {};
  return fail(ErrorCode::kInvalid,
              "is no recording of rosbag2: it has no tables 'topics' and 'messages'", path_);
}

Expected<void> Db3Log::read_topics() {
  const Db3Rows rows = prepare("SELECT id, name, type, serialization_format FROM topics");
  if (!rows) return fail(ErrorCode::kInvalid, "its table 'topics' is none of rosbag2's", path_);
  while (sqlite3_step(rows.get()) == SQLITE_ROW && topics_.size() < kMostTopics) {
    by_id_[sqlite3_column_int64(rows.get(), 0)] = topics_.size();
    const bool cdr = text(rows.get(), 3) == "cdr";
    topics_.push_back({text(rows.get(), 1), plain_type(text(rows.get(), 2)),
                       cdr ? MessageFormat::kCdr : MessageFormat::kOther});
  }
  return {};
}

Expected<void> Db3Log::begin() {
  if (const auto opened = open(); !opened) return opened;
  if (const auto there = require_tables(); !there) return there;
  if (const auto read = read_topics(); !read) return read;
  if (const Db3Rows last = prepare("SELECT max(rowid) FROM messages");
      last && sqlite3_step(last.get()) == SQLITE_ROW)
    last_row_ = sqlite3_column_int64(last.get(), 0);
  // In the order in which they were written: no sorting, whatever the size.
  messages_ = prepare("SELECT topic_id, timestamp, data, rowid FROM messages");
  if (!messages_)
    return fail(ErrorCode::kInvalid, "its table 'messages' is none of rosbag2's", path_);
  return {};
}

Expected<bool> Db3Log::next(LoggedMessage& out) {
  for (;;) {
    const int code = sqlite3_step(messages_.get());
    if (code != SQLITE_ROW) {
      if (code != SQLITE_DONE && failure_.empty()) failure_ = sqlite3_errmsg(file_.get());
      return false;
    }
    row_ = sqlite3_column_int64(messages_.get(), 3);
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

std::vector<std::string> Db3Log::remarks() const {
  std::vector<std::string> all;
  if (!failure_.empty())
    all.push_back("is damaged after row " + std::to_string(row_) + " of " +
                  std::to_string(last_row_) + " (" + failure_ + "): read up to there");
  if (lost_ > 0) all.push_back("has " + std::to_string(lost_) + " messages of no topic");
  return all;
}

}  // namespace

Expected<std::unique_ptr<MessageLog>> open_db3(const std::string& path) {
  auto log = std::make_unique<Db3Log>(path);
  if (const auto begun = log->begin(); !begun) return tl::unexpected(begun.error());
  return log;
}

}  // namespace fiducap
