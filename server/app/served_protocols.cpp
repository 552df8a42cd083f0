#include "app/served_protocols.hpp"

#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap {

std::vector<ServedProtocol> served_protocols(const StreamingConfig& streaming) {
  const auto& vrpn = streaming.vrpn;
  const auto& native = streaming.native;
  return {
      {"vrpn", vrpn.enabled, vrpn.address, {{vrpn.port, false}, {vrpn.port, true}}, vrpn.axes()},
      {"native", native.enabled, native.address, {{native.port, true}}, conventions_of("native").axes},
  };
}

}  // namespace fiducap
