// fiducap_bench fanout: one scene to twenty clients of mixed protocols, server and clients in two
// processes; then the same with one more client of every protocol and transport, once reading and
// once not, and the cost of those for the others. Medians of the repetitions, taken in turn.
#include <poll.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <thread>

#include "base/log.hpp"
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
  SdkClient(const Load& load, const Shared& shared)
      : load_(load), shared_(shared), client_(options(shared)) {
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

void poll_all(std::vector<std::unique_ptr<Sink>>& sinks, const Shared& shared,
              std::uint64_t frames) {
  std::vector<pollfd> waiting;
  for (const auto& sink : sinks) waiting.push_back({sink->fd(), POLLIN, 0});
  std::int64_t spoke = steady_ns();
  while (shared.frames < frames && !shared.failed) {
    for (std::size_t i = 0; i < sinks.size(); ++i)
      waiting[i].events = sinks[i]->reading() ? POLLIN : 0;
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

enum class Bystanders { kNone, kReading, kStalled };

constexpr const char* kTitles[] = {"twenty clients", "and one more of each kind, reading",
                                   "and one more of each kind that never reads"};

struct Outcome {
  std::map<std::string, Sample> by_client;
  double cpu_share{};
  double memory_kB{};
};

/// The clients of one run.
struct Audience {
  std::vector<std::unique_ptr<Sink>> sinks;  ///< The measured ones first.
  std::size_t measured{};
  std::vector<std::unique_ptr<SdkClient>> sdk;

  Audience(const Load& load, const Shared& shared, Bystanders bystanders) {
    for (int i = 0; i < kRawClients; ++i)
      for (auto& one : make_sinks(load, shared)) sinks.push_back(std::move(one));
    measured = sinks.size();
    for (int i = 0; i < kSdkClients; ++i) sdk.push_back(std::make_unique<SdkClient>(load, shared));
    if (bystanders == Bystanders::kNone) return;
    for (auto& one : make_bystanders(load, shared)) sinks.push_back(std::move(one));
  }
  /// Waits for the handshakes.
  void settle(Bystanders bystanders) {
    for (int i = 0; i < 30; ++i) {
      std::this_thread::sleep_for(10ms);
      for (const auto& sink : sinks) sink->pump(steady_ns());
    }
    if (bystanders != Bystanders::kStalled) return;
    for (std::size_t i = measured; i < sinks.size(); ++i) sinks[i]->stop_reading();
  }
  [[nodiscard]] std::vector<const Tally*> tallies() const {
    std::vector<const Tally*> all;
    for (const auto& one : sdk) all.push_back(&one->tally);
    for (std::size_t i = 0; i < measured; ++i) all.push_back(&sinks[i]->tally);
    return all;
  }
};

std::optional<Outcome> run(const Load& load, Bystanders bystanders) {
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
    Audience audience(load, shared, bystanders);
    audience.settle(bystanders);
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
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

void print(const std::vector<Outcome>& runs, Bystanders bystanders) {
  std::printf("%s: server %.1f %% of a core, resident memory %+.0f kB\n",
              kTitles[static_cast<int>(bystanders)],
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
}

void print_change(const std::vector<Outcome>& reading, const std::vector<Outcome>& stalled) {
  std::printf("what those that never read cost the others: p99, median of %zu\n", reading.size());
  for (const auto& [name, first] : reading.front().by_client) {
    const auto p99 = [key = name](const Outcome& o) { return o.by_client.at(key).p99; };
    const double before = median(reading, p99);
    const double after = median(stalled, p99);
    std::printf("  %-24s %10.0f -> %6.0f us %+7.1f %%\n", name.c_str(), before, after,
                100 * (after / before - 1));
  }
}

/// @return exit code
int run_all(const Load& load, int repetitions) {
  constexpr std::array kCases{Bystanders::kNone, Bystanders::kReading, Bystanders::kStalled};
  std::array<std::vector<Outcome>, kCases.size()> outcomes;
  for (int i = 0; i < repetitions; ++i) {
    for (std::size_t k = 0; k < kCases.size(); ++k) {
      auto outcome = run(load, kCases[k]);
      if (!outcome) return 1;
      outcomes[k].push_back(std::move(*outcome));
    }
  }
  std::printf("%d bodies, %.0f Hz, %.0f s; medians of %d\n", load.bodies, load.rate_hz,
              load.seconds, repetitions);
  for (std::size_t k = 0; k < kCases.size(); ++k) print(outcomes[k], kCases[k]);
  print_change(outcomes[1], outcomes[2]);
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
