#include "streaming/dds/listeners.hpp"

namespace fiducap::dds {

namespace {

// As ROS users know it.
std::string shown(const std::string& topic) {
  return topic.starts_with("rt/") ? topic.substr(2) : topic;
}

}  // namespace

void Listeners::begin() {
  for (auto& [participant, listener] : by_participant_) listener.topics.clear();
}

void Listeners::look_at(const Writer& writer) {
  if (!writer.has_readers()) return;
  for (const auto& participant : writer.reading_participants()) {
    auto [place, is_new] = by_participant_.try_emplace(participant);
    Listener& listener = place->second;
    if (is_new) listener.since = clock_.now();
    listener.topics.insert(shown(writer.topic()));
    const Count now{writer.handle(), writer.written(), writer.refused()};
    Count& before = listener.before.try_emplace(writer.topic(), now).first->second;
    if (before.writer != now.writer) before = {now.writer, 0, 0};
    listener.sent += now.written - before.written;
    listener.refused += now.refused - before.refused;
    before = now;
  }
}

void Listeners::append_to(std::vector<ClientStatus>& out) {
  for (auto at = by_participant_.begin(); at != by_participant_.end();) {
    const Listener& listener = at->second;
    if (listener.topics.empty()) {
      at = by_participant_.erase(at);
      continue;
    }
    std::string detail;
    for (const auto& topic : listener.topics) {
      if (detail.size() > 200) {
        detail += " …";
        break;
      }
      detail += (detail.empty() ? "" : " ") + topic;
    }
    out.push_back({"dds", "participant " + at->first, std::move(detail), listener.sent,
                   listener.refused, to_seconds(clock_.now() - listener.since)});
    ++at;
  }
}

}  // namespace fiducap::dds
