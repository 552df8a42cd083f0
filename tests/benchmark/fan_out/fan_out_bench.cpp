// fiducap_fanout_bench [--quick] [--bodies N] [--rate HZ] [--seconds S]: one scene to twenty clients of mixed protocols,
// server and clients in two processes; then the same with one more client per TCP protocol that stops reading.
#include <poll.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <map>
#include <thread>

#include "base/log.hpp"
#include "fan_out/sink.hpp"
#include "fan_out/stage.hpp"
#include "fiducap/client.hpp"

namespace fiducap::fan_out {
namespace {

using namespace std::chrono_literals;

constexpr int kSdkClients = 4;
constexpr int kRawClients = 4;  // of each of the other four protocols

/// The SDK, as a control stack links it.
class SdkClient final {
 public:
  SdkClient(const Load& load, const Shared& shared) : load_(load), shared_(shared), client_(options(shared)) {
    tally.protocol = "native";
    tally.mode = "SDK";
    tally.latency_us.reserve(static_cast<std::size_t>(load.seconds * load.rate_hz));
    client_.on_frame([this](const Frame& frame) {
      tally.take(frame.number, 1e-3 * static_cast<double>(steady_ns() - frame.at_server_ns));
    });
  }
  void stop() { client_.on_frame(nullptr); }
  [[nodiscard]] bool connected() const { return client_.statistics().connected; }

  Tally tally;

 private:
  static ClientOptions options(const Shared& shared) {
    ClientOptions options;
    options.port = shared.ports[Shared::kNative];
    options.name = "fan-out";
    return options;
  }
  Load load_;
  const Shared& shared_;
  Client client_;
};

struct Sample {
  std::uint64_t clients{}, frames{}, missing{};
  float p50{}, p99{}, max{};
};

std::map<std::string, Sample> by_protocol(const std::vector<const Tally*>& tallies) {
  std::map<std::string, std::vector<float>> latency;
  std::map<std::string, Sample> all;
  for (const Tally* one : tallies) {
    Sample& sample = all[one->protocol + ", " + one->mode];
    ++sample.clients;
    sample.frames += one->frames;
    sample.missing += one->missing;
    auto& values = latency[one->protocol + ", " + one->mode];
    values.insert(values.end(), one->latency_us.begin(), one->latency_us.end());
  }
  for (auto& [name, sample] : all) {
    auto& values = latency[name];
    if (values.empty()) continue;
    std::sort(values.begin(), values.end());
    sample.p50 = values[values.size() / 2];
    sample.p99 = values[values.size() * 99 / 100];
    sample.max = values.back();
  }
  return all;
}

void poll_all(std::vector<std::unique_ptr<Sink>>& sinks, const Shared& shared, std::uint64_t frames) {
  std::vector<pollfd> waiting;
  for (const auto& sink : sinks) waiting.push_back({sink->fd(), POLLIN, 0});
  std::int64_t spoke = steady_ns();
  while (shared.frames < frames && !shared.failed) {
    for (std::size_t i = 0; i < sinks.size(); ++i) waiting[i].events = sinks[i]->reading() ? POLLIN : 0;
    ::poll(waiting.data(), waiting.size(), 20);
    for (std::size_t i = 0; i < sinks.size(); ++i)
      if ((waiting[i].revents & POLLIN) != 0) sinks[i]->pump(steady_ns());
    if (steady_ns() - spoke < 1'000'000'000) continue;
    spoke = steady_ns();
    for (const auto& sink : sinks) sink->keep_alive();
  }
  std::this_thread::sleep_for(50ms);  // what is still under way
  for (const auto& sink : sinks) sink->pump(steady_ns());
}

/// @param stalled  one more client of each TCP protocol that never reads
bool run(const Load& load, bool stalled) {
  void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return false;
  auto& shared = *new (memory) Shared();
  const pid_t server = ::fork();
  if (server == 0) std::_Exit(run_stage(load, shared));
  while (!shared.ready && !shared.failed) {
    if (::waitpid(server, nullptr, WNOHANG) == server) return false;
    std::this_thread::sleep_for(1ms);
  }
  std::vector<std::unique_ptr<Sink>> sinks;
  std::vector<std::unique_ptr<SdkClient>> sdk;
  for (int i = 0; i < kRawClients; ++i) {
    for (const auto make : {make_vrpn_sink, make_natnet_sink, make_vicon_sink, make_qualisys_sink})
      sinks.push_back(make(load, shared));
  }
  for (int i = 0; i < kSdkClients; ++i) sdk.push_back(std::make_unique<SdkClient>(load, shared));
  if (stalled) {
    for (const auto make : {make_vrpn_sink, make_vicon_sink, make_qualisys_sink}) {
      sinks.push_back(make(load, shared));
      sinks.back()->tally.mode = "never reads";
      sinks.back()->stop_reading();
    }
  }
  std::this_thread::sleep_for(300ms);  // handshakes
  for (const auto& sink : sinks) sink->pump(steady_ns());
  shared.go = true;
  poll_all(sinks, shared, static_cast<std::uint64_t>(load.seconds * load.rate_hz));
  int status = 0;
  ::waitpid(server, &status, 0);
  std::vector<const Tally*> tallies;
  for (const auto& one : sdk) one->stop();
  for (const auto& one : sdk) tallies.push_back(&one->tally);
  for (const auto& one : sinks) tallies.push_back(&one->tally);
  std::printf("%s: %d bodies, %.0f Hz, %zu clients: server %.1f %% of a core, resident memory %+lld kB\n",
              stalled ? "with clients that never read" : "all read", load.bodies, load.rate_hz, tallies.size(),
              100 * shared.cpu_share.load(), static_cast<long long>(shared.memory_grown_kB.load()));
  std::printf("  %-24s %8s %10s %8s %10s %10s %10s\n", "client", "clients", "frames", "missing", "p50 [us]", "p99 [us]", "max [us]");
  for (const auto& [name, sample] : by_protocol(tallies))
    std::printf("  %-24s %8llu %10llu %8llu %10.0f %10.0f %10.0f\n", name.c_str(),
                static_cast<unsigned long long>(sample.clients), static_cast<unsigned long long>(sample.frames),
                static_cast<unsigned long long>(sample.missing), static_cast<double>(sample.p50),
                static_cast<double>(sample.p99), static_cast<double>(sample.max));
  sdk.clear();
  ::munmap(memory, sizeof(Shared));
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace
}  // namespace fiducap::fan_out

int main(int argc, char** argv) {
  using namespace fiducap::fan_out;
  fiducap::log::set_level(fiducap::log::Level::kError);
  Load load;
  const std::map<std::string, std::function<void(const char*)>> keys{
      {"--bodies", [&](const char* v) { load.bodies = std::atoi(v); }},
      {"--rate", [&](const char* v) { load.rate_hz = std::atof(v); }},
      {"--seconds", [&](const char* v) { load.seconds = std::atof(v); }}};
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--quick") == 0) {
      load.seconds = 3;
    } else if (const auto key = keys.find(argv[i]); key != keys.end() && i + 1 < argc) {
      key->second(argv[++i]);
    } else {
      std::fprintf(stderr, "usage: fiducap_fanout_bench [--quick] [--bodies N] [--rate HZ] [--seconds S]\n");
      return 2;
    }
  }
  return run(load, false) && run(load, true) ? 0 : 1;
}
