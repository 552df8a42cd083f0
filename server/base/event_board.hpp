#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
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

/// What happens, in one place: logged once, kept for the page, the SDK, ROS and the metrics.
///
/// A thing that happens is told; a condition that lasts is begun and ended, however often it is
/// looked at. From any thread; locks for a short step. Never call it per frame unless nothing has
/// changed (`end` of what did not hold costs one look-up).
class EventBoard final {
 public:
  static constexpr std::size_t kKept = 256;      ///< Newest events.
  static constexpr std::size_t kStanding = 256;  ///< Conditions at once; more are only told.

  /// @param utc_ns  wall clock, nanoseconds since 1970
  explicit EventBoard(std::function<std::int64_t()> utc_ns) : utc_ns_(std::move(utc_ns)) {}

  /// It happened.
  void tell(Event event);
  /// It holds from now on: told once, until it is ended. Told again when its severity rises; a new
  /// text alone only replaces the old one.
  void begin(Event event);
  /// It holds no longer: told, as information, if it did.
  void end(std::string_view subject, std::string_view kind, std::string_view text);
  /// `begin` or `end`, whichever `holds` says.
  void set(bool holds, Event event, std::string_view text_when_over);

  /// What holds now, in order of subject and kind.
  [[nodiscard]] std::vector<Event> standing() const;
  /// The newest events after `number`, oldest first.
  [[nodiscard]] std::vector<Event> after(std::uint64_t number) const;
  /// How many events there were since the start, by severity.
  [[nodiscard]] std::array<std::uint64_t, 3> told() const;
  /// Counts every change of what `standing` or `after` would say.
  [[nodiscard]] std::uint64_t revision() const;

 private:
  using Key = std::pair<std::string, std::string>;  ///< Subject, kind.
  struct Order {
    using is_transparent = void;
    using View = std::pair<std::string_view, std::string_view>;
    bool operator()(const View& a, const View& b) const { return a < b; }
  };
  void keep(Event& event);

  std::function<std::int64_t()> utc_ns_;
  mutable std::mutex mutex_;
  std::deque<Event> events_;
  std::map<Key, Event, Order> standing_;
  std::uint64_t newest_{0};
  std::uint64_t revision_{0};
  std::array<std::uint64_t, 3> told_{};
};

}  // namespace fiducap
