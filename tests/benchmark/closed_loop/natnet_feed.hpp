#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "closed_loop/feedback.hpp"

namespace fiducap::loop {

/// A NatNet 4.1 client as small as an autopilot's: unicast, rigid bodies only. NatNet carries no
/// velocity, so it is the difference of positions through a low pass of 30 ms, as such clients do.
class NatNetFeed final {
 public:
  NatNetFeed(std::uint16_t port, std::int32_t body_id);
  ~NatNetFeed();
  NatNetFeed(const NatNetFeed&) = delete;
  NatNetFeed& operator=(const NatNetFeed&) = delete;

  /// Waits for the next frame, at most 100 ms. @return nullopt when none came or the body is not
  /// tracked in it
  [[nodiscard]] std::optional<Sensed> next();

 private:
  void keep_alive();

  int socket_;
  std::int32_t body_id_;
  std::uint16_t port_;
  std::int64_t spoke_ns_{0};
  std::optional<Sensed> last_;
};

}  // namespace fiducap::loop
