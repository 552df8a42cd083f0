#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fiducap {

enum class Severity { kInfo, kWarning, kError };

[[nodiscard]] std::string_view name_of(Severity severity);

/// Something that a person should know: whose, what, why, and what to do about it.
struct Event {
  std::uint64_t number{};  ///< Counts up from 1 for the life of the server; the board's.
  std::int64_t utc_ms{};   ///< Wall clock, milliseconds since 1970; the board's.
  Severity severity{Severity::kInfo};
  std::string subject;   ///< A body's name, or a part: `map`, `recorder`, `clock`, `server`, …
  std::string kind;      ///< One word for programs: `lost`, `source_late`, `overload`, …
  std::string text;      ///< What happened and why, without the subject.
  std::string remedy{};  ///< What to do; empty: nothing.
  bool over{};           ///< A condition of this subject and kind ended here.

  /// `drone: lost, … – do this`
  [[nodiscard]] std::string sentence() const;
};

/// What the board says at one moment; never changes.
struct EventSheet {
  using Events = std::vector<std::shared_ptr<const Event>>;
  std::uint64_t revision{};             ///< Counts every change of what follows.
  Events happened;                      ///< The newest, oldest first.
  Events standing;                      ///< What holds, in order of subject and kind.
  std::array<std::uint64_t, 3> told{};  ///< Events since the start, by severity.

  /// Those of `happened` after `number`.
  [[nodiscard]] std::span<const std::shared_ptr<const Event>> after(std::uint64_t number) const;
};

/// What happens, in one place: logged once, kept for the page, the SDK, ROS and the metrics.
///
/// A thing that happens is told; a condition that lasts is begun and ended, however often it is
/// looked at. From any thread. Who writes waits for who writes; who reads never waits for that: he
/// gets a sheet. Never write per frame unless nothing has changed (`end` of what did not hold costs
/// one look-up).
class EventBoard final {
 public:
  static constexpr std::size_t kKept = 256;  ///< Newest events.
  /// Conditions at once. Of more than that one is `server crowded`, and errors go before the rest.
  static constexpr std::size_t kStanding = 256;

  /// @param utc_ns  wall clock, nanoseconds since 1970
  explicit EventBoard(std::function<std::int64_t()> utc_ns) : utc_ns_(std::move(utc_ns)) {}

  /// It happened.
  void tell(Event event);
  /// It holds from now on: told once, until it is ended. Told again when its severity rises; any
  /// other change only replaces text, remedy and severity, all of them.
  void begin(Event event);
  /// It holds no longer: told, as information, if it did.
  void end(std::string_view subject, std::string_view kind, std::string_view text);
  /// `begin` or `end`, whichever `holds` says.
  void set(bool holds, Event event, std::string_view text_when_over);

  /// Who is told of as `subject` is shown as `name` from now on, also in what stands; those who
  /// tell go on with `subject`.
  void rename(std::string_view subject, std::string_view name);

  /// What holds now, in order of subject and kind.
  [[nodiscard]] std::vector<Event> standing() const;
  /// The newest events after `number`, oldest first.
  [[nodiscard]] std::vector<Event> after(std::uint64_t number) const;
  /// How many events there were since the start, by severity.
  [[nodiscard]] std::array<std::uint64_t, 3> told() const { return sheet()->told; }
  /// Counts every change of what `standing` or `after` would say.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] std::shared_ptr<const EventSheet> sheet() const;
  /// For who may not wait at all: the newest sheet, unless somebody changes it at this moment; then
  /// `sheet` stays, for the next look.
  void refresh(std::shared_ptr<const EventSheet>& sheet) const;

 private:
  using Shared = std::shared_ptr<const Event>;
  using Key = std::pair<std::string, std::string>;  ///< Subject, kind; as they are told.
  struct Order {
    using is_transparent = void;
    using View = std::pair<std::string_view, std::string_view>;
    bool operator()(const View& a, const View& b) const { return a < b; }
  };
  template <typename Work>
  void change(Work&& work);
  Shared keep(Event event);
  void show_name(Event& event) const;
  void start(Event event);
  [[nodiscard]] bool has_room_for(Severity severity);
  void say_that_it_is_crowded();
  void finish(std::string_view subject, std::string_view kind, std::string_view text);
  void show();

  std::function<std::int64_t()> utc_ns_;
  std::mutex writing_;  ///< For what follows.
  std::deque<Shared> happened_;
  std::map<Key, Shared, Order> standing_;
  std::vector<Shared> unlogged_;
  std::map<std::string, std::string, std::less<>> names_;  ///< Of subjects that were renamed.
  std::uint64_t newest_{0};
  std::array<std::uint64_t, 3> told_{};
  bool has_changed_{false};  ///< Since the sheet was written.

  mutable std::mutex showing_;  ///< For the two below; held for a pointer's copy.
  std::shared_ptr<const EventSheet> sheet_{std::make_shared<const EventSheet>()};
  std::atomic<std::uint64_t> revision_{0};
};

}  // namespace fiducap
