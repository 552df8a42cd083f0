// fiducap_bench client: readings of the client while frames arrive at 1 kHz over a real socket.
// Each reading is timed with two readings of the clock (about 40 ns) inside; the maxima are the
// scheduler's.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

#include "bench.hpp"
#include "fiducap/client.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap::bench {
namespace {

template <typename Read>
void measure_readings(const char* what, int bodies, int readers, Read&& read) {
  constexpr int kReadings = 200'000;
  std::vector<double> each;
  each.reserve(kReadings);
  read();
  const auto begin = monotonic_ns();
  for (int i = 0; i < kReadings; ++i) {
    const auto from = monotonic_ns();
    read();
    each.push_back(static_cast<double>(monotonic_ns() - from));
  }
  const double mean = static_cast<double>(monotonic_ns() - begin) / kReadings;
  std::sort(each.begin(), each.end());
  std::printf("%-22s %4d bodies %2d reader(s)  mean %7.0f  p50 %7.0f  p99 %7.0f  max %9.0f ns\n",
              what, bodies, readers, mean, each[kReadings / 2], each[kReadings * 99 / 100],
              each.back());
}

void read_client(int bodies, int readers) {
  auto scene = make_scene_frame(numbered_names(bodies), 1);
  TestServer server(*scene);
  Client client(options_for(server.port()));
  Frame frame;
  if (!publish_until(server, *scene,
                     [&] { return client.statistics().frames > 50 && client.latest(frame); }))
    return;
  std::vector<std::jthread> others;
  others.emplace_back([&](std::stop_token stop) {
    while (!stop.stop_requested()) {
      ++scene->number;
      server.publish(std::make_shared<SceneFrame>(*scene));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  for (int i = 1; i < readers; ++i) {
    others.emplace_back([&](std::stop_token stop) {
      Frame own;
      while (!stop.stop_requested()) (void)client.latest(own);
    });
  }
  Body body;
  measure_readings("latest", bodies, readers, [&] { (void)client.latest(frame); });
  measure_readings("predict one body", bodies, readers,
                   [&] { (void)client.predict("body0", std::chrono::milliseconds(20), body); });
}

}  // namespace

Bench add_client(CLI::App&, const bool&) {
  return [] {
    for (const int bodies : {1, 8, 100}) read_client(bodies, 1);
    read_client(8, 4);
    return 0;
  };
}

}  // namespace fiducap::bench
