// fiducap_client_bench: what a reader of the client pays, while frames come in at 1 kHz over a real
// socket. Each reading is timed with two looks at the clock (about 40 ns) inside; the maxima are
// the scheduler's.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>
#include <vector>

#include "fiducap/client.hpp"
#include "unit/client/test_server.hpp"

namespace fiducap {
namespace {

constexpr int kReadings = 200'000;

struct Cost {
  double mean_ns;
  double p50_ns, p99_ns, max_ns;
};

template <typename Read>
Cost cost_of(Read&& read) {
  std::vector<double> each;
  each.reserve(kReadings);
  const auto begin = monotonic_ns();
  for (int i = 0; i < kReadings; ++i) {
    const auto from = monotonic_ns();
    read();
    each.push_back(static_cast<double>(monotonic_ns() - from));
  }
  const double mean = static_cast<double>(monotonic_ns() - begin) / kReadings;
  std::sort(each.begin(), each.end());
  return {mean, each[kReadings / 2], each[kReadings * 99 / 100], each.back()};
}

void print(const char* what, int bodies, int readers, const Cost& cost) {
  std::printf("%-22s %4d bodies %2d reader(s)  mean %7.0f  p50 %7.0f  p99 %7.0f  max %9.0f ns\n",
              what, bodies, readers, cost.mean_ns, cost.p50_ns, cost.p99_ns, cost.max_ns);
}

void bench(int bodies, int readers) {
  auto scene = make_scene_frame(names(bodies), 1);
  TestServer server(*scene);
  Client client(options_for(server.port()));
  Frame frame;
  if (!publish_until(server, *scene,
                     [&] { return client.statistics().frames > 50 && client.latest(frame); }))
    return;
  std::atomic<bool> stop{false};
  std::thread publisher([&] {
    while (!stop) {
      ++scene->number;
      server.publish(std::make_shared<SceneFrame>(*scene));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  std::vector<std::thread> others;
  for (int i = 1; i < readers; ++i) {
    others.emplace_back([&] {
      Frame own;
      while (!stop) (void)client.latest(own);
    });
  }
  const auto count = [&](const char* what, auto&& read) {
    read();
    print(what, bodies, readers, cost_of(read));
  };
  Body body;
  count("latest", [&] { (void)client.latest(frame); });
  count("predict one body",
        [&] { (void)client.predict("body0", std::chrono::milliseconds(20), body); });
  stop = true;
  publisher.join();
  for (auto& other : others) other.join();
}

}  // namespace
}  // namespace fiducap

int main() {
  for (const int bodies : {1, 8, 100}) fiducap::bench(bodies, 1);
  fiducap::bench(8, 4);
}
