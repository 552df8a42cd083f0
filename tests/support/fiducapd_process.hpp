#pragma once

#include <unistd.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "support/child_process.hpp"
#include "support/loopback_socket.hpp"

namespace fiducap {

inline std::string demo_file() { return FIDUCAP_SOURCE_DIR "/config/demo.yaml"; }

/// For the demo: ready corners instead of images (a thousandth of the cost).
inline std::vector<std::string> corners_on_free_ports() {
  return {"--set", "streaming.vrpn.port=0",
          "--set", "streaming.native.port=0",
          "--set", "streaming.web.port=0",
          "--set", "bodies.0.source.camera.images=false",
          "--set", "bodies.1.source.camera.images=false",
          "--set", "bodies.2.source.camera.images=false"};
}

inline std::uint16_t free_port() {
  const int any = bound_socket(SOCK_STREAM);
  const std::uint16_t port = port_of(any);
  ::close(any);
  return port;
}

/// fiducapd with these arguments.
class FiducapdProcess final : public ChildProcess {
 public:
  explicit FiducapdProcess(std::vector<std::string> arguments, int output_to = -1)
      : ChildProcess(with_program(std::move(arguments)), output_to) {}

 private:
  static std::vector<std::string> with_program(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), FIDUCAP_BINARY_DIR "/bin/fiducapd");
    return arguments;
  }
};

}  // namespace fiducap
