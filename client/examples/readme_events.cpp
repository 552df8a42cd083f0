#include <fiducap/events.hpp>

#include <cstdio>

int main() {
  fiducap::EventWatch watch({});
  fiducap::ServerEvent event;
  while (watch.next(event, std::chrono::seconds(10))) {
    std::printf("%s: %s. %s\n", event.subject.c_str(), event.text.c_str(), event.remedy.c_str());
  }
  for (const auto& alarm : watch.standing()) std::printf("still: %s\n", alarm.text.c_str());
  if (!watch.problem().empty()) std::printf("%s\n", watch.problem().c_str());
}
