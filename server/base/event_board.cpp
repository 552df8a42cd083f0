#include "base/event_board.hpp"

#include <algorithm>
#include <tuple>

#include "base/log.hpp"

namespace fiducap {

namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;
// Subject and kind of the condition that stands for those without a place.
constexpr std::pair<std::string_view, std::string_view> kCrowded{"server", "crowded"};
// Below this many it is over: not at the first that ends, for the next one to begin it again.
constexpr std::size_t kRoomAgain = EventBoard::kStanding * 3 / 4;

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

std::span<const std::shared_ptr<const Event>> EventSheet::after(std::uint64_t number) const {
  const auto first = std::find_if(happened.begin(), happened.end(),
                                  [&](const auto& event) { return event->number > number; });
  return {first, happened.end()};
}

/// One change: made and shown, then logged while nobody waits for it.
template <typename Work>
void EventBoard::change(Work&& work) {
  std::vector<Shared> news;
  {
    const std::lock_guard lock(writing_);
    work();
    if (has_changed_) show();
    news.swap(unlogged_);
  }
  for (const Shared& event : news)
    log::write(level_of(event->severity), "event", event->sentence(), event->subject);
}

void EventBoard::tell(Event event) {
  change([&] { keep(std::move(event)); });
}

void EventBoard::begin(Event event) {
  change([&] {
    const auto known = standing_.find(Order::View{event.subject, event.kind});
    if (known == standing_.end()) return start(std::move(event));
    const Event& held = *known->second;
    if (event.severity > held.severity) {
      known->second = keep(std::move(event));
    } else if (std::tie(event.severity, event.text, event.remedy) !=
               std::tie(held.severity, held.text, held.remedy)) {
      event.number = held.number;
      event.utc_ms = held.utc_ms;
      show_name(event);
      known->second = std::make_shared<const Event>(std::move(event));
      has_changed_ = true;
    }
  });
}

void EventBoard::end(std::string_view subject, std::string_view kind, std::string_view text) {
  change([&] {
    finish(subject, kind, text);
    if (standing_.size() < kRoomAgain)
      finish(kCrowded.first, kCrowded.second, "everything that is wrong is listed again");
  });
}

void EventBoard::set(bool holds, Event event, std::string_view text_when_over) {
  if (holds) return begin(std::move(event));
  end(event.subject, event.kind, text_when_over);
}

void EventBoard::start(Event event) {
  if (!has_room_for(event.severity)) return say_that_it_is_crowded();
  Key key{event.subject, event.kind};
  standing_.emplace(std::move(key), keep(std::move(event)));
}

/// The last place is kept for saying that there is none. An error takes that of something less,
/// which waits until there is room again.
bool EventBoard::has_room_for(Severity severity) {
  if (standing_.size() + 1 < kStanding) return true;
  if (severity != Severity::kError) return false;
  const auto less = std::find_if(standing_.begin(), standing_.end(), [](const auto& one) {
    return one.second->severity < Severity::kError && Order::View(one.first) != kCrowded;
  });
  if (less == standing_.end()) return false;
  standing_.erase(less);
  has_changed_ = true;
  return true;
}

void EventBoard::say_that_it_is_crowded() {
  if (standing_.find(kCrowded) != standing_.end()) return;
  const auto [subject, kind] = kCrowded;
  standing_.emplace(Key{subject, kind},
                    keep({.severity = Severity::kWarning,
                          .subject = std::string(subject),
                          .kind = std::string(kind),
                          .text = "more than " + std::to_string(kStanding - 1) +
                                  " things are wrong at once: the rest is not listed",
                          .remedy = "See to those that are; then the others follow"}));
}

void EventBoard::finish(std::string_view subject, std::string_view kind, std::string_view text) {
  const auto known = standing_.find(Order::View{subject, kind});
  if (known == standing_.end()) return;
  keep({.subject = std::string(subject),
        .kind = std::string(kind),
        .text = std::string(text),
        .over = true});
  standing_.erase(known);
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

void EventBoard::show_name(Event& event) const {
  const auto name = names_.find(event.subject);
  if (name != names_.end()) event.subject = name->second;
}

EventBoard::Shared EventBoard::keep(Event event) {
  show_name(event);
  event.number = newest_ + 1;
  event.utc_ms = utc_ns_() / kNsPerMs;
  const auto kept = std::make_shared<const Event>(std::move(event));
  unlogged_.push_back(kept);
  happened_.push_back(kept);
  if (happened_.size() > kKept) happened_.pop_front();
  ++newest_;
  ++told_.at(static_cast<std::size_t>(kept->severity));
  has_changed_ = true;
  return kept;
}

void EventBoard::show() {
  auto sheet = std::make_shared<EventSheet>();
  sheet->revision = revision_ + 1;
  sheet->happened.assign(happened_.begin(), happened_.end());
  sheet->standing.reserve(standing_.size());
  for (const auto& [key, event] : standing_) sheet->standing.push_back(event);
  sheet->told = told_;
  std::shared_ptr<const EventSheet> old = std::move(sheet);  // let go of without the lock
  const std::lock_guard lock(showing_);
  sheet_.swap(old);
  revision_ = sheet_->revision;
  has_changed_ = false;
}

std::shared_ptr<const EventSheet> EventBoard::sheet() const {
  const std::lock_guard lock(showing_);
  return sheet_;
}

void EventBoard::refresh(std::shared_ptr<const EventSheet>& sheet) const {
  if (sheet && sheet->revision == revision_) return;
  std::shared_ptr<const EventSheet> newest;
  {
    const std::unique_lock lock(showing_, std::try_to_lock);
    if (!lock) return;
    newest = sheet_;
  }
  sheet.swap(newest);
}

std::vector<Event> EventBoard::standing() const {
  std::vector<Event> all;
  const auto newest = sheet();
  for (const Shared& event : newest->standing) all.push_back(*event);
  return all;
}

std::vector<Event> EventBoard::after(std::uint64_t number) const {
  std::vector<Event> newer;
  const auto newest = sheet();
  for (const Shared& event : newest->after(number)) newer.push_back(*event);
  return newer;
}

}  // namespace fiducap
