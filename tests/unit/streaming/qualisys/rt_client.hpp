#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "streaming/qualisys/codec.hpp"

namespace fiducap::qualisys {

/// A client on real loopback sockets that reads on request.
class RtClient final {
 public:
  explicit RtClient(std::uint16_t port, std::endian order = std::endian::little);
  ~RtClient();
  RtClient(const RtClient&) = delete;
  RtClient& operator=(const RtClient&) = delete;

  void say(std::string_view command);
  void send(std::span<const std::byte> bytes);
  /// Opens a UDP socket. @return its port
  std::uint16_t open_udp();
  /// Reads all that came; never waits.
  void pump();
  [[nodiscard]] bool heard(std::string_view text) const;
  [[nodiscard]] int frames() const {
    return static_cast<int>(tcp_frames.size() + udp_frames.size());
  }

  std::vector<std::string> texts;
  std::vector<Event> events;
  std::vector<std::vector<std::byte>> tcp_frames;
  std::vector<std::vector<std::byte>> udp_frames;
  int no_more_data{0};
  bool closed{false};

 private:
  std::endian order_;
  int tcp_;
  int udp_{-1};
  std::vector<std::byte> in_;
};

}  // namespace fiducap::qualisys
