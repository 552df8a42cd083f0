#include "base/event_board.hpp"

#include <algorithm>

#include "base/log.hpp"

namespace fiducap {

namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;

log::Level level_of(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return log::Level::kInfo;
    case Severity::kWarning:
      return log::Level::kWarning;
    case Severity::kError:
      return log::Level::kError;
  }
  return log::Level::kError;
}

}  // namespace

std::string_view name_of(Severity severity) { return log::name_of(level_of(severity)); }

std::string Event::sentence() const {
  const bool ends = !text.empty() && (text.back() == '.' || text.back() == '?');
  return subject + ": " + text + (remedy.empty() ? "" : (ends ? " " : ". ") + remedy);
}

void EventBoard::tell(Event event) {
  const std::lock_guard lock(mutex_);
  keep(event);
}

void EventBoard::begin(Event event) {
  const std::lock_guard lock(mutex_);
  const auto known = standing_.find(Key{event.subject, event.kind});
  if (known == standing_.end()) {
    keep(event);
    if (standing_.size() < kStanding) standing_.emplace(Key{event.subject, event.kind}, event);
    return;
  }
  Event& held = known->second;
  if (event.severity > held.severity) {
    keep(event);
    held = std::move(event);
  } else if (event.text != held.text) {
    held.text = std::move(event.text);
    ++revision_;
  }
}

void EventBoard::end(std::string_view subject, std::string_view kind, std::string_view text) {
  const std::lock_guard lock(mutex_);
  const auto known = standing_.find(Order::View{subject, kind});
  if (known == standing_.end()) return;
  standing_.erase(known);
  Event event{.subject = std::string(subject),
              .kind = std::string(kind),
              .text = std::string(text),
              .over = true};
  keep(event);
}

void EventBoard::set(bool holds, Event event, std::string_view text_when_over) {
  if (holds) return begin(std::move(event));
  end(event.subject, event.kind, text_when_over);
}

void EventBoard::keep(Event& event) {
  event.number = ++newest_;
  event.utc_ms = utc_ns_() / kNsPerMs;
  ++revision_;
  ++told_.at(static_cast<std::size_t>(event.severity));
  log::write(level_of(event.severity), "event", event.sentence());
  if (events_.size() == kKept) events_.pop_front();
  events_.push_back(event);
}

std::vector<Event> EventBoard::standing() const {
  const std::lock_guard lock(mutex_);
  std::vector<Event> all;
  for (const auto& [key, event] : standing_) all.push_back(event);
  return all;
}

std::vector<Event> EventBoard::after(std::uint64_t number) const {
  const std::lock_guard lock(mutex_);
  const auto first = std::find_if(events_.begin(), events_.end(),
                                  [&](const Event& event) { return event.number > number; });
  return {first, events_.end()};
}

std::array<std::uint64_t, 3> EventBoard::told() const {
  const std::lock_guard lock(mutex_);
  return told_;
}

std::uint64_t EventBoard::revision() const {
  const std::lock_guard lock(mutex_);
  return revision_;
}

}  // namespace fiducap
