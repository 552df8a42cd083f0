#include "daemon/access_keeper.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include <fcntl.h>
#include <fmt/chrono.h>
#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "daemon/system.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPeriod{1};
constexpr mode_t kMode = 0640;
constexpr std::size_t kLongestText = 500;

/// Changes whenever the file is written or replaced; empty: not readable.
std::string state_of(const std::string& file) {
  struct stat about {};
  if (::stat(file.c_str(), &about) != 0) return {};
  return fmt::format("{} {} {}.{}", about.st_ino, about.st_size, about.st_ctim.tv_sec,
                     about.st_ctim.tv_nsec);
}

std::string utc_text(std::int64_t utc_ns) {
  return fmt::format("{:%FT%T}.{:03}Z", fmt::gmtime(utc_ns / 1'000'000'000),
                     utc_ns / 1'000'000 % 1000);
}

std::string shown(const std::string& text) { return printable(text, kLongestText); }

}  // namespace

AccessKeeper::AccessKeeper(OperatorConfig config, EventBoard& events, const Clock& clock)
    : events_(events),
      clock_(clock),
      audit_file_(std::move(config.audit_file)),
      operate_{std::move(config.token), config.token_file, "operator.token_file"},
      read_{std::move(config.read_token), config.read_token_file, "operator.read_token_file"} {
  for (Token* token : {&operate_, &read_})
    if (!token->file.empty()) token->seen = state_of(token->file);
}

std::string AccessKeeper::token() const {
  const std::lock_guard lock(mutex_);
  return operate_.text;
}

std::string AccessKeeper::read_token() const {
  const std::lock_guard lock(mutex_);
  return read_.text;
}

std::uint64_t AccessKeeper::tokens_changed() const {
  const std::lock_guard lock(mutex_);
  return changes_;
}

void AccessKeeper::note(const Requester& by, const std::string& what,
                        const Expected<void>& result) {
  add(by, what, result ? "done" : "failed: " + result.error().text(), 0);
}

void AccessKeeper::note_refusal(const Requester& by, const std::string& what,
                                const std::string& why) {
  std::uint64_t omitted = 0;
  {
    const std::lock_guard lock(mutex_);
    if (!refusals_.take(1, kRefusals, kRefusals_per_s, clock_.now())) {
      ++omitted_;
      return;
    }
    omitted = std::exchange(omitted_, 0);
  }
  add(by, what, "refused: " + why, omitted);
}

void AccessKeeper::add(const Requester& by, const std::string& what, const std::string& result,
                       std::uint64_t omitted) {
  const std::string who = by.address + " (" + std::string(by.protocol) +
                          (by.right.empty() ? "" : ", " + std::string(by.right)) + ")";
  log::info("audit", who + " " + shown(what) + ": " + shown(result) +
                         (omitted > 0 ? "; " + std::to_string(omitted) + " refusals omitted" : ""));
  if (audit_file_.empty()) return;
  nlohmann::ordered_json line{{"utc", utc_text(utc_now_ns())}, {"protocol", by.protocol},
                              {"address", by.address},         {"right", by.right},
                              {"what", shown(what)},           {"result", shown(result)}};
  if (omitted > 0) line["omitted_refusals"] = omitted;
  const std::lock_guard lock(mutex_);
  if (waiting_.size() >= kMostWaiting) {
    ++dropped_;
    return;
  }
  waiting_.push_back(line.dump() + "\n");
  added_.notify_one();
}

void AccessKeeper::run(std::stop_token stop) {
  running_ = true;
  while (!stop.stop_requested()) {
    tick();
    std::unique_lock lock(mutex_);
    added_.wait_for(lock, stop, kPeriod, [this] { return !waiting_.empty(); });
  }
  write();
  running_ = false;
}

void AccessKeeper::tick() {
  write();
  for (Token* token : {&operate_, &read_})
    if (!token->file.empty()) refresh(*token);
}

void AccessKeeper::write() {
  std::string lines;
  {
    const std::lock_guard lock(mutex_);
    for (const std::string& line : waiting_) lines += line;
    if (dropped_ > 0)
      lines += nlohmann::json{{"utc", utc_text(utc_now_ns())}, {"lines_dropped", dropped_}}.dump() +
               "\n";
    waiting_.clear();
    dropped_ = 0;
  }
  if (lines.empty()) return;
  const auto done = append(lines);
  events_.set(!done,
              {.severity = Severity::kError,
               .subject = "server",
               .kind = "audit",
               .text = "the audit log cannot be written: " + (done ? "" : done.error().text()),
               .remedy = "Check the disk and the folder of `operator.audit_file`"},
              "the audit log is written again");
}

Expected<void> AccessKeeper::append(const std::string& lines) const {
  std::error_code error;
  const auto size = fs::file_size(audit_file_, error);
  if (!error && size + lines.size() > kLargestFile_bytes) {
    for (int i = kOlderFiles; i > 0; --i)
      fs::rename(i > 1 ? audit_file_ + "." + std::to_string(i - 1) : audit_file_,
                 audit_file_ + "." + std::to_string(i), error);
  }
  const Descriptor file(::open(audit_file_.c_str(),
                               O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC,
                               kMode));
  struct stat about {};
  const bool is_open = file.number() >= 0 && ::fstat(file.number(), &about) == 0;
  if (is_open && !S_ISREG(about.st_mode))
    return fail(ErrorCode::kInvalid, "must be a plain file", audit_file_);
  const auto written = is_open ? ::write(file.number(), lines.data(), lines.size()) : ssize_t{-1};
  if (written == static_cast<ssize_t>(lines.size()) && ::fdatasync(file.number()) == 0) return {};
  return fail(ErrorCode::kUnavailable, written < 0 ? std::strerror(errno) : "the disk is full",
              audit_file_);
}

void AccessKeeper::refresh(Token& token) {
  const std::string state = state_of(token.file);
  if (state == token.seen) return;
  token.seen = state;
  auto read = read_token_file(token.file);
  if (read && read->empty()) read = fail(ErrorCode::kInvalid, "is empty", token.file);
  events_.set(!read,
              {.severity = Severity::kWarning,
               .subject = "server",
               .kind = token.key,
               .text = token.key + ": " + (read ? "" : read.error().text()) +
                       "; the earlier token stays valid",
               .remedy = "Write a token into the file"},
              token.key + " is valid again");
  if (!read) return;
  {
    const std::lock_guard lock(mutex_);
    if (*read == token.text) return;
    token.text = std::move(*read);
    ++changes_;
  }
  note({"server", token.key, "this machine"}, "replace the token", {});
}

}  // namespace fiducap
