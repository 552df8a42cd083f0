#pragma once

#include <cstdint>
#include <string>

#include "base/config_check.hpp"

namespace fiducap {

/// How the bytes of a sensor get in: by a serial line, or as datagrams to a UDP port.
struct LinkConfig {
  std::string device;              ///< e.g. `/dev/ttyACM0`; empty: UDP.
  int baud{115200};                ///< Any rate that the line can do; 8N1. USB devices ignore it.
  std::string address{"0.0.0.0"};  ///< UDP, ours.
  std::uint16_t port{0};  ///< UDP, ours; 0: any free one, for a peer that we speak to first.
  std::string
      peer;  ///< UDP: only this address is heard, `192.168.1.20` or with a port; empty: any.

  /// By UDP, from other machines, and the first one that speaks is taken.
  [[nodiscard]] bool takes_the_first_sender() const;
  /// The rules of the line, into the checker of whoever has it.
  void check(Checker& checker) const;
};

/// Keys of a configuration, see daemon/config/config_schema.hpp; they stand beside those of who has
/// it.
template <class V>
void describe(V& v, LinkConfig& c) {
  v.value("device", c.device);
  v.value("baud", c.baud);
  v.value("address", c.address);
  v.value("port", c.port);
  v.value("peer", c.peer);
}

}  // namespace fiducap
