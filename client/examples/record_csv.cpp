// Writes every pose of every frame as CSV until Ctrl-C or for some seconds: record_csv FILE
// [seconds] [host] [port]
#include <fiducap/client.hpp>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <limits>

namespace {

volatile std::sig_atomic_t stop_requested = 0;

void write(std::FILE* file, const fiducap::Frame& frame) {
  for (const auto& body : frame.bodies) {
    if (!body.valid) continue;
    const auto& p = body.position_m;
    const auto& q = body.orientation_wxyz;
    std::fprintf(file, "%lld,%lld,%llu,%s,%.6f,%.6f,%.6f,%.8f,%.8f,%.8f,%.8f,%.6f,%.6f\n",
                 static_cast<long long>(frame.at_server_ns),
                 static_cast<long long>(frame.at_utc_ns),
                 static_cast<unsigned long long>(frame.number), body.name.c_str(), p[0], p[1], p[2],
                 q[0], q[1], q[2], q[3], body.position_sigma_m, body.rotation_sigma_rad);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: record_csv FILE [seconds] [host] [port]\n");
    return 2;
  }
  std::FILE* file = std::fopen(argv[1], "w");
  if (file == nullptr) {
    std::perror(argv[1]);
    return 1;
  }
  std::fprintf(
      file,
      "server_ns,utc_ns,frame,body,px,py,pz,qw,qx,qy,qz,position_sigma_m,rotation_sigma_rad\n");
  const double seconds = argc > 2 ? std::atof(argv[2]) : std::numeric_limits<double>::infinity();
  fiducap::ClientOptions options;
  options.name = "record_csv";
  if (argc > 3) options.server = argv[3];
  if (argc > 4) options.port = static_cast<std::uint16_t>(std::atoi(argv[4]));
  std::signal(SIGINT, [](int) { stop_requested = 1; });

  const fiducap::Client client(options);
  fiducap::Frame frame;
  const auto start = std::chrono::steady_clock::now();
  while (stop_requested == 0 &&
         std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() <
             seconds) {
    if (client.wait_for_frame(frame.number, std::chrono::milliseconds(100)) && client.latest(frame))
      write(file, frame);
  }
  const auto statistics = client.statistics();
  std::fprintf(stderr, "%llu frames, %llu lost on the way\n",
               static_cast<unsigned long long>(statistics.frames),
               static_cast<unsigned long long>(statistics.lost));
  return std::fclose(file) == 0 ? 0 : 1;
}
