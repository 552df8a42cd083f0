#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/time.hpp"

namespace fiducap {

enum class Severity { kInfo, kWarning, kError };

[[nodiscard]] std::string_view name_of(Severity severity);

/// Something that happened, for a user: subject, cause and remedy.
struct Event {
  std::uint64_t number{};  ///< Counts up from 1 for the life of the server; set by the board.
  std::int64_t utc_ms{};   ///< Wall clock, milliseconds since 1970; set by the board.
  Severity severity{Severity::kInfo};
  std::string subject;   ///< A body's name, or a part: `map`, `recorder`, `clock`, `server`, …
  std::string kind;      ///< One word for programs: `lost`, `source_late`, `overload`, …
  std::string text;      ///< What happened and why, without the subject.
  std::string remedy{};  ///< What to do; empty: nothing.
  bool over{};           ///< A condition of this subject and kind ended here.

  /// `drone: lost, … – do this`
  [[nodiscard]] std::string sentence() const {
    const bool ends = !text.empty() && (text.back() == '.' || text.back() == '?');
    return subject + ": " + text + (remedy.empty() ? "" : (ends ? " " : ". ") + remedy);
  }
};

/// Contents of the board at one moment; immutable.
struct EventSnapshot {
  using Events = std::vector<std::shared_ptr<const Event>>;
  std::uint64_t revision{};               ///< Counts every change of the fields below.
  Events happened;                        ///< The newest, oldest first.
  Events standing;                        ///< Conditions that hold, by subject and kind.
  std::array<std::uint64_t, 3> counts{};  ///< Events since the start, by severity.

  /// Those of `happened` after `number`.
  [[nodiscard]] std::span<const std::shared_ptr<const Event>> after(std::uint64_t number) const {
    const auto first =
        std::ranges::find_if(happened, [&](const auto& event) { return event->number > number; });
    return {first, happened.end()};
  }
};

/// Events and lasting conditions of the server: logged once, kept for all kinds of clients.
///
/// An event is reported; a condition begins and ends; repeated calls change nothing. Thread-safe:
/// readers get immutable snapshots and never wait for a writer. Do not change it for each frame.
class EventBoard final {
 public:
  static constexpr std::size_t kKept = 256;  ///< Newest events.
  /// Conditions at once. The last place is for `server crowded`; errors displace lower severities.
  static constexpr std::size_t kStanding = 256;

  /// @param utc_ns  wall clock, nanoseconds since 1970
  /// @param hold  for this long a condition must hold before it is published, and be over before it
  /// ends, as `settle` finds; 0: it changes at once. Errors are published at once.
  explicit EventBoard(std::function<std::int64_t()> utc_ns, Duration hold = {})
      : utc_ns_(std::move(utc_ns)), hold_(hold) {}

  void report(Event event);
  /// The condition holds: an event, unless it held before. A higher severity is another event; any
  /// other change replaces text, remedy and severity only.
  void begin(Event event);
  /// The condition no longer holds: an event with severity info, if it held before.
  void end(std::string_view subject, std::string_view kind, std::string_view text);
  void set(bool holds, Event event, std::string_view text_when_over) {
    if (holds) return begin(std::move(event));
    end(event.subject, event.kind, text_when_over);
  }
  /// Publishes what has held for long enough. Needed about twice a second.
  void settle(Instant now);

  /// Shows `subject` as `name`, also in conditions that hold. Writers keep using `subject`.
  void rename(std::string_view subject, std::string_view name);

  [[nodiscard]] std::vector<Event> standing() const;
  /// The newest events after `number`, oldest first.
  [[nodiscard]] std::vector<Event> after(std::uint64_t number) const;
  [[nodiscard]] std::array<std::uint64_t, 3> counts() const { return snapshot()->counts; }
  /// Counts every change of `standing` and `after`.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] std::shared_ptr<const EventSnapshot> snapshot() const {
    const std::lock_guard lock(publishing_);
    return snapshot_;
  }
  /// Replaces `snapshot` by the newest one; keeps it while another thread publishes. Never waits.
  void refresh(std::shared_ptr<const EventSnapshot>& snapshot) const;

 private:
  using Shared = std::shared_ptr<const Event>;
  /// A condition that has begun, or is over, a moment ago.
  struct Unsettled {
    Event event;
    std::optional<Instant> since{};  ///< The first `settle` after it.
  };
  using Key = std::pair<std::string, std::string>;  ///< Subject, kind; as reported.
  struct Order {
    using is_transparent = void;
    using View = std::pair<std::string_view, std::string_view>;
    bool operator()(const View& a, const View& b) const { return a < b; }
  };
  template <typename Work>
  void change(Work&& work);
  Shared keep(Event event);
  void apply_name(Event& event) const {
    const auto name = names_.find(event.subject);
    if (name != names_.end()) event.subject = name->second;
  }
  [[nodiscard]] bool has_room_for(Severity severity);
  void add(Event event);
  void report_overflow();
  /// @return false: it is published at once
  bool waits(Event& event);
  void finish(std::string_view subject, std::string_view kind, std::string_view text);
  void publish();

  std::function<std::int64_t()> utc_ns_;
  Duration hold_;
  std::mutex writing_;  ///< Protects the fields below, up to the next mutex.
  std::deque<Shared> happened_;
  std::map<Key, Shared, Order> standing_;
  std::map<Key, Unsettled, Order> unsettled_;  ///< At most kStanding.
  std::vector<Shared> unlogged_;
  std::map<std::string, std::string, std::less<>> names_;  ///< Of renamed subjects.
  std::uint64_t newest_{0};
  std::array<std::uint64_t, 3> counts_{};
  bool has_changed_{false};  ///< Since the last snapshot.

  mutable std::mutex publishing_;  ///< Held while a pointer is copied.
  std::shared_ptr<const EventSnapshot> snapshot_{std::make_shared<const EventSnapshot>()};
  std::atomic<std::uint64_t> revision_{0};
};

}  // namespace fiducap
