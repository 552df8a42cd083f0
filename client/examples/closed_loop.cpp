// Holds a body at a place: closed_loop BODY X Y Z [host] [port] [seconds]. Commands go to stdout as
// t,ax,ay,az; put your robot where they are printed. Three rules for a control loop: wait for
// frames instead of a timer; use the pose at the instant when the command takes effect; without a
// valid, recent pose do the safe thing.
#include <fiducap/client.hpp>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include "cascade.hpp"

namespace {

using namespace std::chrono_literals;
using Steady = std::chrono::steady_clock;

// Delay from the command to the force of your robot.
constexpr auto kActuatorDelay = 15ms;
// Largest sigma of a pose that is used.
constexpr double kMostSigma_m = 0.05;

/// @return false: brake, land, hold still
bool usable(const fiducap::Client& client, const std::string& name, fiducap::Body& body) {
  return client.predict_now(name, kActuatorDelay, body) && body.position_sigma_m < kMostSigma_m;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5) {
    std::fprintf(stderr, "usage: closed_loop BODY X Y Z [host] [port] [seconds]\n");
    return 2;
  }
  const std::string name = argv[1];
  const fiducap::examples::Vector target{std::atof(argv[2]), std::atof(argv[3]),
                                         std::atof(argv[4])};
  fiducap::ClientOptions options;
  options.name = "closed_loop";
  options.bodies = {name};
  options.covariance = false;
  if (argc > 5) options.server = argv[5];
  if (argc > 6) options.port = static_cast<std::uint16_t>(std::atoi(argv[6]));
  const double seconds = argc > 7 ? std::atof(argv[7]) : std::numeric_limits<double>::infinity();

  const fiducap::Client client(options);
  fiducap::examples::Cascade cascade({});
  fiducap::Frame frame;
  fiducap::Body body;
  const auto start = Steady::now();
  auto before = start;
  while (std::chrono::duration<double>(Steady::now() - start).count() < seconds) {
    const bool fresh = client.wait_for_frame(frame.number, 20ms) && client.latest(frame);
    const auto now = Steady::now();
    const double dt_s = std::min(0.05, std::chrono::duration<double>(now - before).count());
    before = now;
    if (!fresh || !usable(client, name, body)) {
      cascade.reset();
      std::printf("safe\n");
      continue;
    }
    const auto command = cascade.update(target, body.position_m, body.velocity_m_s, dt_s);
    std::printf("%.6f,%.4f,%.4f,%.4f\n", std::chrono::duration<double>(now - start).count(),
                command[0], command[1], command[2]);
  }
}
