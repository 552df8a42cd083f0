// fiducap_bench fanout: one scene to twenty clients of mixed protocols, server and clients in two
// processes. Medians of the repetitions.
#include <poll.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <thread>

#include "base/log.hpp"
#include "base/numeric.hpp"
#include "bench.hpp"
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
  SdkClient(const Load& load, const Shared& shared) : client_(options(shared)) {
    tally.protocol = "native";
    tally.mode = "SDK";
    tally.latency_us.reserve(static_cast<std::size_t>(load.seconds * load.rate_hz));
    client_.on_frame([this](const Frame& frame) {
      tally.take(frame.number, 1e-3 * static_cast<double>(steady_ns() - frame.at_server_ns));
    });
  }
  void stop() { client_.on_frame(nullptr); }

  Tally tally;

 private:
  static ClientOptions options(const Shared& shared) {
    ClientOptions options;
    options.port = shared.ports[Shared::kNative];
    options.name = "fan-out";
    return options;
  }
  Client client_;
};

struct Sample {
  std::uint64_t clients{}, frames{}, missing{};
  double p50{}, p99{}, max{};  ///< Latency, µs.
};

std::map<std::string, Sample> by_protocol(const std::vector<const Tally*>& tallies) {
  std::map<std::string, std::vector<double>> latency;
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
    sample.p50 = quantile(latency[name], 0.5);
    sample.p99 = quantile(latency[name], 0.99);
    sample.max = quantile(latency[name], 1);
  }
  return all;
}

void poll_all(std::vector<std::unique_ptr<Sink>>& sinks, const Shared& shared,
              std::uint64_t frames) {
  std::vector<pollfd> waiting;
  for (const auto& sink : sinks) waiting.push_back({sink->fd(), POLLIN, 0});
  std::int64_t spoke = steady_ns();
  while (shared.frames < frames && !shared.failed) {
    ::poll(waiting.data(), waiting.size(), 20);
    for (std::size_t i = 0; i < sinks.size(); ++i)
      if ((waiting[i].revents & POLLIN) != 0) sinks[i]->pump(steady_ns());
    if (steady_ns() - spoke < 1'000'000'000) continue;
    spoke = steady_ns();
    for (const auto& sink : sinks) sink->keep_alive();
  }
  // The frames that are still under way, at their own times.
  for (const std::int64_t end = steady_ns() + 100'000'000; steady_ns() < end;) {
    ::poll(waiting.data(), waiting.size(), 5);
    for (const auto& sink : sinks) sink->pump(steady_ns());
  }
}

struct Outcome {
  std::map<std::string, Sample> by_client;
  double cpu_share{};
  double memory_kB{};
};

/// The clients of one run.
struct Audience {
  std::vector<std::unique_ptr<Sink>> sinks;
  std::vector<std::unique_ptr<SdkClient>> sdk;

  Audience(const Load& load, const Shared& shared) {
    for (int i = 0; i < kRawClients; ++i)
      for (auto& one : make_sinks(load, shared)) sinks.push_back(std::move(one));
    for (int i = 0; i < kSdkClients; ++i) sdk.push_back(std::make_unique<SdkClient>(load, shared));
    for (int i = 0; i < 30; ++i) {  // the handshakes
      std::this_thread::sleep_for(10ms);
      for (const auto& sink : sinks) sink->pump(steady_ns());
    }
  }
  [[nodiscard]] std::vector<const Tally*> tallies() const {
    std::vector<const Tally*> all;
    for (const auto& one : sdk) all.push_back(&one->tally);
    for (const auto& one : sinks) all.push_back(&one->tally);
    return all;
  }
};

std::optional<Outcome> run(const Load& load) {
  void* memory =
      ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return std::nullopt;
  auto& shared = *new (memory) Shared();
  const pid_t server = ::fork();
  if (server == 0) std::_Exit(run_stage(load, shared));
  while (!shared.ready && !shared.failed) {
    if (::waitpid(server, nullptr, WNOHANG) == server) return std::nullopt;
    std::this_thread::sleep_for(1ms);
  }
  std::optional<Outcome> outcome;
  int status = 0;
  {
    Audience audience(load, shared);
    shared.go = true;
    poll_all(audience.sinks, shared, static_cast<std::uint64_t>(load.seconds * load.rate_hz));
    ::waitpid(server, &status, 0);
    for (const auto& one : audience.sdk) one->stop();
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
      outcome = Outcome{by_protocol(audience.tallies()), shared.cpu_share,
                        static_cast<double>(shared.memory_grown_kB)};
  }
  ::munmap(memory, sizeof(Shared));
  return outcome;
}

template <typename Get>
double median(const std::vector<Outcome>& runs, Get get) {
  std::vector<double> values;
  for (const Outcome& one : runs) values.push_back(static_cast<double>(get(one)));
  return quantile(std::move(values), 0.5);
}

/// @return exit code
int run_all(const Load& load, int repetitions) {
  std::vector<Outcome> runs;
  for (int i = 0; i < repetitions; ++i) {
    auto outcome = run(load);
    if (!outcome) return 1;
    runs.push_back(std::move(*outcome));
  }
  std::printf(
      "%d bodies, %.0f Hz, %.0f s; medians of %d: server %.1f %% of a core, resident memory %+.0f "
      "kB\n",
      load.bodies, load.rate_hz, load.seconds, repetitions,
      100 * median(runs, [](const Outcome& o) { return o.cpu_share; }),
      median(runs, [](const Outcome& o) { return o.memory_kB; }));
  std::printf("  %-24s %8s %10s %8s %10s %10s %10s\n", "client", "clients", "frames", "missing",
              "p50 [us]", "p99 [us]", "max [us]");
  for (const auto& [name, first] : runs.front().by_client) {
    const auto of = [&, key = name](auto member) {
      return median(runs, [&](const Outcome& o) { return o.by_client.at(key).*member; });
    };
    std::printf("  %-24s %8.0f %10.0f %8.0f %10.0f %10.0f %10.0f\n", name.c_str(),
                of(&Sample::clients), of(&Sample::frames), of(&Sample::missing), of(&Sample::p50),
                of(&Sample::p99), of(&Sample::max));
  }
  return 0;
}

}  // namespace
}  // namespace fiducap::fan_out

namespace fiducap::bench {

Bench add_fanout(CLI::App& verb, const bool& quick) {
  const auto load = std::make_shared<fan_out::Load>();
  const auto repetitions = std::make_shared<int>(1);
  verb.add_option("--bodies", load->bodies, "in the scene");
  verb.add_option("--rate", load->rate_hz, "of the frames, Hz");
  verb.add_option("--seconds", load->seconds, "of each run");
  verb.add_option("--repeat", *repetitions, "runs")->check(CLI::Range(1, 1000));
  return [=, &quick] {
    log::set_level(log::Level::kError);
    if (quick) load->seconds = 3;
    return fan_out::run_all(*load, *repetitions);
  };
}

}  // namespace fiducap::bench
