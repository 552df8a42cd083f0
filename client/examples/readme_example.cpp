#include <fiducap/client.hpp>

#include <chrono>
#include <cstdio>

int main() {
  fiducap::ClientOptions options;
  options.server = "127.0.0.1";
  fiducap::Client client(options);  // connects in the background, comes back by itself

  fiducap::Frame frame;
  for (int i = 0; i < 100; ++i) {
    if (!client.wait_for_frame(frame.number, std::chrono::seconds(1))) {
      std::printf("no frame: %s\n", client.statistics().problem.c_str());
    } else if (client.latest(frame)) {
      for (const auto& body : frame.bodies) {
        if (!body.valid) continue;  // never fly with a pose that is not valid
        std::printf("%s at %.3f %.3f %.3f\n", body.name.c_str(), body.position_m[0],
                    body.position_m[1], body.position_m[2]);
      }
    }
  }
}
