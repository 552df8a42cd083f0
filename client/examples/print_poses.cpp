// Prints every body once a second until Ctrl-C: print_poses [host] [port]
#include <fiducap/client.hpp>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <thread>

namespace {

volatile std::sig_atomic_t stop_requested = 0;

const char* word(fiducap::Tracking tracking) {
  switch (tracking) {
    case fiducap::Tracking::kSearching:
      return "searching";
    case fiducap::Tracking::kTracking:
      return "tracking";
    case fiducap::Tracking::kCoasting:
      return "coasting";
    case fiducap::Tracking::kLost:
      return "lost";
  }
  return "";
}

void print(const fiducap::Frame& frame) {
  for (const auto& body : frame.bodies) {
    std::printf("%-16s %-9s", body.name.c_str(), word(body.tracking));
    if (body.valid) {
      const auto& p = body.position_m;
      const auto& q = body.orientation_wxyz;
      std::printf("  p %8.3f %8.3f %8.3f m  q %7.4f %7.4f %7.4f %7.4f  +/- %.1f mm", p[0], p[1],
                  p[2], q[0], q[1], q[2], q[3], body.position_sigma_m * 1e3);
    }
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, [](int) { stop_requested = 1; });
  fiducap::ClientOptions options;
  options.name = "print_poses";
  if (argc > 1) options.server = argv[1];
  if (argc > 2) options.port = static_cast<std::uint16_t>(std::atoi(argv[2]));
  const fiducap::Client client(options);
  fiducap::Frame frame;
  while (stop_requested == 0) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    const auto statistics = client.statistics();
    if (!statistics.connected) {
      std::printf("not connected: %s\n", statistics.problem.c_str());
    } else if (client.latest(frame)) {
      std::printf("frame %llu  %.1f Hz  %llu lost  latency p50 %.2f ms  p99 %.2f ms\n",
                  static_cast<unsigned long long>(frame.number), statistics.rate_hz,
                  static_cast<unsigned long long>(statistics.lost), statistics.latency_p50_s * 1e3,
                  statistics.latency_p99_s * 1e3);
      print(frame);
    }
    std::fflush(stdout);
  }
  return 0;
}
