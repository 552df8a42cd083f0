#include <exception>

#include "fiducap.h"
#include "fiducap/events.hpp"
#include "src/c_struct.hpp"

struct fiducap_events {
  explicit fiducap_events(fiducap::EventOptions options) : watch(std::move(options)) {}
  fiducap::EventWatch watch;
};

namespace fiducap::sdk {

namespace {

fiducap_event to_c(const ServerEvent& event) {
  fiducap_event out{};
  out.severity = static_cast<std::int32_t>(event.severity);
  out.over = event.over ? 1 : 0;
  out.number = event.number;
  out.at_utc_ms = event.at_utc_ms;
  give_text(event.subject, out.subject, sizeof(out.subject));
  give_text(event.kind, out.kind, sizeof(out.kind));
  give_text(event.text, out.text, sizeof(out.text));
  give_text(event.remedy, out.remedy, sizeof(out.remedy));
  return out;
}

}  // namespace

}  // namespace fiducap::sdk

namespace sdk = fiducap::sdk;

fiducap_events* fiducap_events_open(const char* server, uint16_t port, int history) {
  try {
    fiducap::EventOptions options;
    options.server = sdk::text_or(server, "127.0.0.1");
    if (port != 0) options.port = port;
    options.history = history != 0;
    return new fiducap_events(std::move(options));
  } catch (const std::exception&) {
    return nullptr;
  }
}

void fiducap_events_close(fiducap_events* events) { delete events; }

int fiducap_events_next(fiducap_events* events, uint32_t timeout_ms, fiducap_event* event,
                        char* problem, size_t problem_size) {
  if (events == nullptr) return 0;
  try {
    fiducap::ServerEvent next;
    const bool came = events->watch.next(next, std::chrono::milliseconds(timeout_ms));
    sdk::give_text(came ? "" : events->watch.problem(), problem, problem_size);
    return came && sdk::give(sdk::to_c(next), event) ? 1 : 0;
  } catch (const std::exception& why) {
    sdk::give_text(why.what(), problem, problem_size);
    return 0;
  }
}

uint32_t fiducap_events_standing(const fiducap_events* events, fiducap_event* standing,
                                 uint32_t capacity) {
  if (events == nullptr) return 0;
  const auto& all = events->watch.standing();
  for (std::size_t i = 0; standing != nullptr && i < std::min<std::size_t>(capacity, all.size());
       ++i) {
    auto* at = reinterpret_cast<unsigned char*>(standing) + i * standing->struct_size;
    if (!sdk::give(sdk::to_c(all[i]), reinterpret_cast<fiducap_event*>(at))) break;
  }
  return static_cast<uint32_t>(all.size());
}
