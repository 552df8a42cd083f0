#include <cmath>
#include <cstdio>
#include <thread>

#include "bench.hpp"
#include "daemon/server.hpp"
#include "daemon/system.hpp"
#include "fiducap/client.hpp"

namespace fiducap::bench {
namespace {

// An uncommon port, so that a server that runs on this machine is left alone.
constexpr std::uint16_t kPort = 42617;

constexpr const char* kConfig = R"(
simulation: {preset: hall}
map: {mode: mapping}
bodies:
  - name: robot
    source: {type: simulator, camera: {images: false}, trajectory: {kind: survey}}
    cameras:
      - model: {width: 752, height: 480, fu: 460, fv: 460, cu: 376, cv: 240}
        X_BV: {p: [0.1, 0, 0], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
        rate_hz: 20
streaming:
  rate_hz: 200
  vrpn: {enabled: false}
  web: {enabled: false}
)";

}  // namespace

void bench_latency(const Options& options, std::vector<Row>& rows) {
  Row row{"latency, instant of pose to client", "frame at 200 Hz", 0, 0, ""};
  const auto config =
      parse_config(kConfig, "bench", {"streaming.native.port=" + std::to_string(kPort)});
  const SystemClock clock;
  auto server = config ? Server::build(*config, {}, clock)
                       : fail(ErrorCode::kInvalid, config.error().front().text());
  if (!server) {
    row.remark = "not measured: " + server.error().text();
    rows.push_back(row);
    return;
  }
  std::thread serving([&] { (void)(*server)->run(); });
  {
    ClientOptions to_server;
    to_server.port = kPort;
    Client client(to_server);
    std::this_thread::sleep_for(options.quick ? std::chrono::seconds(2) : std::chrono::seconds(8));
    const ClientStatistics statistics = client.statistics();
    row.median_us = 1e6 * statistics.latency_p50_s;
    row.p99_us = 1e6 * statistics.latency_p99_s;
    char remark[96];
    std::snprintf(remark, sizeof remark, "real time; %llu frames, %llu lost, %.1f Hz",
                  static_cast<unsigned long long>(statistics.frames),
                  static_cast<unsigned long long>(statistics.lost), statistics.rate_hz);
    row.remark = remark;
  }
  (*server)->stop();
  serving.join();
  rows.push_back(row);
}

}  // namespace fiducap::bench
