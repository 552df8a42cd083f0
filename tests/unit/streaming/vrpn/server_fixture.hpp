#pragma once

#include "streaming/vrpn/vrpn.hpp"
#include "strict_client.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::vrpn {

class VrpnServerTest : public ProtocolServerTest<StrictClient, VrpnConfig> {
 protected:
  Expected<std::unique_ptr<Streamer>> make_server(
      std::shared_ptr<const SceneModel> model) override {
    return start_vrpn_server(io_, config_, std::move(model), clock_);
  }
};

}  // namespace fiducap::vrpn
