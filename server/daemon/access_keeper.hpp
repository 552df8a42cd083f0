#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <stop_token>
#include <string>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "daemon/operator_token.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/operator_api.hpp"

namespace fiducap {

/// The tokens, and the audit log of their use. Thread-safe; a thread of its own reads changed token
/// files and writes the audit log.
///
/// A line of the audit log has who (protocol, address, right), what and result. Changes are bounded
/// by the queue. Refusals have a budget, so that they do not fill the disk; omitted ones are
/// counted in the next line.
class AccessKeeper final {
 public:
  static constexpr std::size_t kMostWaiting = 1000;
  static constexpr double kRefusals = 20;              ///< Lines at once, and …
  static constexpr double kRefusals_per_s = 1.0 / 60;  ///< … from then on.
  static constexpr std::uintmax_t kLargestFile_bytes = 4 << 20;
  static constexpr int kOlderFiles = 4;  ///< `FILE.1` is the newest.

  /// @param config  with the tokens of its files, see with_tokens
  AccessKeeper(OperatorConfig config, EventBoard& events, const Clock& clock);

  [[nodiscard]] std::string token() const;
  [[nodiscard]] std::string read_token() const;
  /// Counts changes of the tokens.
  [[nodiscard]] std::uint64_t tokens_changed() const;

  /// A change of the server's state, or an attempt that had the right to it.
  void note(const Requester& by, const std::string& what, const Expected<void>& result);
  /// A wrong proof, or an attempt without the right.
  void note_refusal(const Requester& by, const std::string& what, const std::string& why);

  /// Until stopped; then writes the last lines.
  void run(std::stop_token stop);
  /// @return `run` has not returned
  [[nodiscard]] bool is_running() const { return running_; }
  /// Writes what waits, and reads the token files that have changed.
  void tick();

 private:
  /// A token and the state of its file.
  struct Token {
    std::string text;
    std::string file;  ///< Empty: none.
    std::string key;   ///< That names the file.
    std::string seen{};
  };
  void add(const Requester& by, const std::string& what, const std::string& result,
           std::uint64_t omitted);
  void write();
  [[nodiscard]] Expected<void> append(const std::string& lines) const;
  void refresh(Token& token);

  EventBoard& events_;
  const Clock& clock_;
  const std::string audit_file_;
  std::atomic<bool> running_{false};
  mutable std::mutex mutex_;  ///< Of the members below.
  std::condition_variable_any added_;
  Token operate_, read_;
  std::uint64_t changes_{0};
  std::deque<std::string> waiting_;
  std::uint64_t dropped_{0};
  net::TokenBucket refusals_;
  std::uint64_t omitted_{0};  ///< Refusals since the last line.
};

}  // namespace fiducap
