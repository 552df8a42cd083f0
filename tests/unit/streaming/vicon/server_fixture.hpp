#pragma once

#include "streaming/vicon/vicon.hpp"
#include "strict_client.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::vicon {

class ViconServerTest : public ProtocolServerTest<StrictClient, ViconConfig> {
 protected:
  Expected<std::unique_ptr<Streamer>> make_server(std::shared_ptr<const SceneModel>) override {
    return start_vicon_server(io_, config_, clock_);
  }
  /// Connected and greeted, with the types sent.
  void open(StrictClient& client, const std::set<std::uint32_t>& types = client::kSegments) {
    client.connect(port_);
    clients_.push_back(&client);
    ASSERT_TRUE(until([&] { return client.view.greeted; }));
    client.want(types);
    steps(3);
  }
};

}  // namespace fiducap::vicon
