#include "base/event_board.hpp"

#include <algorithm>
#include <tuple>

#include "base/log.hpp"

namespace fiducap {

namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;
// Subject and kind of the condition that reports that others have no place.
constexpr std::pair<std::string_view, std::string_view> kOverflow{"server", "crowded"};
// The overflow ends below this number of conditions; hysteresis.
constexpr std::size_t kOverflowEnds = EventBoard::kStanding * 3 / 4;

/// Severities are the levels above debug.
log::Level level_of(Severity severity) {
  return static_cast<log::Level>(static_cast<int>(severity) + static_cast<int>(log::Level::kInfo));
}

std::vector<Event> copies_of(std::span<const std::shared_ptr<const Event>> events) {
  std::vector<Event> all;
  for (const auto& event : events) all.push_back(*event);
  return all;
}

}  // namespace

std::string_view name_of(Severity severity) { return log::name_of(level_of(severity)); }

/// Makes and publishes one change, then logs it without the lock.
template <typename Work>
void EventBoard::change(Work&& work) {
  std::vector<Shared> unlogged;
  {
    const std::lock_guard lock(writing_);
    work();
    if (has_changed_) publish();
    unlogged.swap(unlogged_);
  }
  for (const Shared& event : unlogged)
    log::write(level_of(event->severity), "event", event->sentence(), event->subject);
}

void EventBoard::report(Event event) {
  change([&] { keep(std::move(event)); });
}

void EventBoard::begin(Event event) {
  change([&] {
    const auto known = standing_.find(Order::View{event.subject, event.kind});
    if (known == standing_.end()) {
      if (event.severity == Severity::kError || !waits(event)) add(std::move(event));
      return;
    }
    if (const auto ending = unsettled_.find(known->first); ending != unsettled_.end())
      unsettled_.erase(ending);
    const Event& held = *known->second;
    if (event.severity > held.severity) {
      known->second = keep(std::move(event));
    } else if (std::tie(event.severity, event.text, event.remedy) !=
               std::tie(held.severity, held.text, held.remedy)) {
      event.number = held.number;
      event.utc_ms = held.utc_ms;
      apply_name(event);
      known->second = std::make_shared<const Event>(std::move(event));
      has_changed_ = true;
    }
  });
}

void EventBoard::end(std::string_view subject, std::string_view kind, std::string_view text) {
  change([&] {
    const Order::View key{subject, kind};
    const auto waiting = unsettled_.find(key);
    if (standing_.find(key) == standing_.end()) {
      if (waiting != unsettled_.end()) unsettled_.erase(waiting);  // never published
      return;
    }
    if (waiting != unsettled_.end()) return;
    Event over{
        .subject = std::string(subject), .kind = std::string(kind), .text = std::string(text)};
    if (!waits(over)) finish(subject, kind, text);
  });
}

void EventBoard::settle(Instant now) {
  change([&] {
    for (auto next = unsettled_.begin(); next != unsettled_.end();) {
      const auto one = next++;
      Unsettled& what = one->second;
      if (!what.since) what.since = now;
      if (now - *what.since < hold_) continue;
      const auto due = unsettled_.extract(one);
      const auto& [subject, kind] = due.key();
      if (standing_.find(due.key()) != standing_.end())
        finish(subject, kind, due.mapped().event.text);
      else
        add(due.mapped().event);
    }
  });
}

bool EventBoard::waits(Event& event) {
  if (hold_ == Duration::zero()) return false;
  const auto known = unsettled_.find(Order::View{event.subject, event.kind});
  if (known == unsettled_.end() && unsettled_.size() == kStanding) return false;
  if (known != unsettled_.end()) {
    known->second.event = std::move(event);
    return true;
  }
  Key key{event.subject, event.kind};
  unsettled_.emplace(std::move(key), Unsettled{std::move(event)});
  return true;
}

void EventBoard::add(Event event) {
  Key key{event.subject, event.kind};
  if (const auto waiting = unsettled_.find(key); waiting != unsettled_.end())
    unsettled_.erase(waiting);
  if (!has_room_for(event.severity)) return report_overflow();
  standing_.emplace(std::move(key), keep(std::move(event)));
}

/// The last place is reserved for the overflow. An error displaces a condition of lower severity.
bool EventBoard::has_room_for(Severity severity) {
  if (standing_.size() + 1 < kStanding) return true;
  if (severity != Severity::kError) return false;
  const auto less = std::ranges::find_if(standing_, [](const auto& one) {
    return one.second->severity < Severity::kError && Order::View(one.first) != kOverflow;
  });
  if (less == standing_.end()) return false;
  standing_.erase(less);
  has_changed_ = true;
  return true;
}

void EventBoard::report_overflow() {
  if (standing_.find(kOverflow) != standing_.end()) return;
  const auto [subject, kind] = kOverflow;
  standing_.emplace(Key{subject, kind},
                    keep({.severity = Severity::kWarning,
                          .subject = std::string(subject),
                          .kind = std::string(kind),
                          .text = "more than " + std::to_string(kStanding - 1) +
                                  " conditions hold at once; the others are not listed",
                          .remedy = "Resolve those that are listed; the others then follow"}));
}

void EventBoard::finish(std::string_view subject, std::string_view kind, std::string_view text) {
  const auto known = standing_.find(Order::View{subject, kind});
  if (known == standing_.end()) return;
  keep({.subject = std::string(subject),
        .kind = std::string(kind),
        .text = std::string(text),
        .over = true});
  standing_.erase(known);
  if (standing_.size() < kOverflowEnds)
    finish(kOverflow.first, kOverflow.second, "all conditions are listed again");
}

void EventBoard::rename(std::string_view subject, std::string_view name) {
  change([&] {
    names_.insert_or_assign(std::string(subject), std::string(name));
    for (auto& [key, held] : standing_) {
      if (key.first != subject) continue;
      Event event = *held;
      event.subject = name;
      held = std::make_shared<const Event>(std::move(event));
      has_changed_ = true;
    }
  });
}

EventBoard::Shared EventBoard::keep(Event event) {
  apply_name(event);
  event.number = newest_ + 1;
  event.utc_ms = utc_ns_() / kNsPerMs;
  const auto kept = std::make_shared<const Event>(std::move(event));
  unlogged_.push_back(kept);
  happened_.push_back(kept);
  if (happened_.size() > kKept) happened_.pop_front();
  ++newest_;
  ++counts_.at(static_cast<std::size_t>(kept->severity));
  has_changed_ = true;
  return kept;
}

void EventBoard::publish() {
  auto next = std::make_shared<EventSnapshot>();
  next->revision = revision_ + 1;
  next->happened.assign(happened_.begin(), happened_.end());
  next->standing.reserve(standing_.size());
  for (const auto& [key, event] : standing_) next->standing.push_back(event);
  next->counts = counts_;
  std::shared_ptr<const EventSnapshot> old = std::move(next);  // destroyed without the lock
  const std::lock_guard lock(publishing_);
  snapshot_.swap(old);
  revision_ = snapshot_->revision;
  has_changed_ = false;
}

void EventBoard::refresh(std::shared_ptr<const EventSnapshot>& snapshot) const {
  if (snapshot && snapshot->revision == revision_) return;
  std::shared_ptr<const EventSnapshot> newest;
  {
    const std::unique_lock lock(publishing_, std::try_to_lock);
    if (!lock) return;
    newest = snapshot_;
  }
  snapshot.swap(newest);
}

std::vector<Event> EventBoard::standing() const { return copies_of(snapshot()->standing); }

std::vector<Event> EventBoard::after(std::uint64_t number) const {
  const auto newest = snapshot();
  return copies_of(newest->after(number));
}

}  // namespace fiducap
