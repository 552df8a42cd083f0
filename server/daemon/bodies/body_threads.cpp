#include "daemon/bodies/body_threads.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "base/this_thread.hpp"

namespace fiducap {

void BodyThreads::start(std::function<void()> all_ended) {
  running_ = workers_.size();
  for (const auto& worker : workers_) {
    BodyWorker* body = worker.get();
    computing_.emplace_back([this, body, all_ended](std::stop_token stop) {
      name_this_thread("work " + body->name());
      body->work(stop);
      if (--running_ == 0 && !stop.stop_requested()) all_ended();
    });
    for (std::size_t source = 0; source < body->sources(); ++source) {
      reading_.push_back({body, source, std::jthread([body, source](std::stop_token stop) {
                            name_this_thread("read " + body->name());
                            body->read(source, stop);
                          })});
    }
  }
}

bool BodyThreads::some_are_reading() const {
  return std::any_of(reading_.begin(), reading_.end(),
                     [](const auto& reader) { return reader.body->reading(reader.source); });
}

bool BodyThreads::stop(Duration patience) {
  constexpr Duration kLook = std::chrono::milliseconds(5);
  for (auto& reader : reading_) reader.thread.request_stop();
  for (auto& thread : computing_) thread.request_stop();
  for (auto& thread : computing_) thread.join();
  computing_.clear();
  const Instant until = clock_.now() + patience;
  while (!reading_.empty() && some_are_reading() && clock_.now() < until) {
    if (!clock_.wait_until(clock_.now() + kLook, {})) break;
  }
  bool all = true;
  for (auto& reader : reading_) {
    if (reader.body->reading(reader.source)) {
      log::warning("capture",
                   reader.body->name() + ": the device does not let go; it is left behind");
      all = false;
    } else {
      reader.thread.join();
    }
  }
  if (all) reading_.clear();
  return all;
}

void BodyThreads::log_statistics() const {
  for (const auto& worker : workers_) {
    log::info("daemon", worker->name() + ": " + worker->statistics().text());
    for (const auto& line : worker->learned_text())
      log::info("daemon", worker->name() + ": " + line);
    for (const auto& line : worker->doubts()) log::warning("daemon", worker->name() + ": " + line);
  }
}

std::vector<LearnedBody> BodyThreads::learned() const {
  std::vector<LearnedBody> all;
  for (const auto& worker : workers_) {
    LearnedBody& body = all.emplace_back(LearnedBody{worker->name(), worker->learned()});
    for (const CameraMount& told : worker->told_cameras())
      body.told_shifts.push_back(told.time_shift);
  }
  return all;
}

}  // namespace fiducap
