#include <gmock/gmock.h>

#include "streaming/natnet/natnet.hpp"

namespace fiducap::natnet {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> faults(const NatNetConfig& config) {
  std::vector<std::string> paths;
  for (const auto& error : config.check()) paths.push_back(error.path);
  return paths;
}

TEST(NatNetConfig, ReportsEveryBrokenRule) {
  NatNetConfig config;
  config.address = "localhost";
  config.multicast_group = "10.0.0.1";
  config.multicast_interface = "eth0";
  config.bitstream = "4.5";
  config.up = UpAxis::kDown;
  config.targets = {"10.0.0.7", "10.0.0.7:0", "10.0.0.7:1511"};
  config.max_clients = 0;
  config.client_timeout_s = 0;
  EXPECT_THAT(faults(config),
              testing::UnorderedElementsAre(
                  "streaming.natnet.address", "streaming.natnet.multicast_group",
                  "streaming.natnet.multicast_interface", "streaming.natnet.bitstream",
                  "streaming.natnet.up", "streaming.natnet.targets", "streaming.natnet.targets",
                  "streaming.natnet.max_clients", "streaming.natnet.client_timeout_s"));
}

TEST(NatNetConfig, TrustsItsNetworksAndItsTargets) {
  NatNetConfig config;
  config.networks = {"10.1.0.0/16", "10.1.0.0/33", "lab"};
  config.targets = {"10.0.0.7:1511"};
  EXPECT_THAT(faults(config),
              ElementsAre("streaming.natnet.networks", "streaming.natnet.networks"));
  config.networks.resize(1);
  EXPECT_THAT(faults(config), IsEmpty());
  EXPECT_THAT(config.trusted_networks(),
              ElementsAre(*net::parse_network("10.1.0.0/16"), *net::parse_network("10.0.0.7")));
}

TEST(NatNetConfig, NamedClientsAreTheOnlyOnesBesideItsTargets) {
  NatNetConfig config;
  config.clients = {"10.0.0.8", "10.2.0.0/16", "lab"};
  config.networks = {"10.1.0.0/16"};
  EXPECT_THAT(faults(config), ElementsAre("streaming.natnet.networks", "streaming.natnet.clients"));
  config.clients.pop_back();
  config.networks.clear();
  config.targets = {"10.0.0.7:1511"};
  EXPECT_THAT(faults(config), IsEmpty());
  EXPECT_THAT(config.trusted_networks(),
              ElementsAre(*net::parse_network("10.0.0.8"), *net::parse_network("10.2.0.0/16"),
                          *net::parse_network("10.0.0.7")));
}

TEST(NatNetConfig, RequiresADataPortForMulticast) {
  NatNetConfig config;
  config.unicast = false;
  EXPECT_TRUE(config.check().empty());
  config.data_port = 0;
  EXPECT_THAT(faults(config), ElementsAre("streaming.natnet.data_port"));
  config.multicast = false;
  EXPECT_THAT(faults(config), ElementsAre("streaming.natnet.unicast"));
}

TEST(NatNetConfig, ATargetMayBeAGroup) {
  NatNetConfig config;
  config.targets = {"224.0.0.1:9000", "10.0.0.7:1511"};
  EXPECT_THAT(faults(config), IsEmpty());
  EXPECT_THAT(config.groups(),
              ElementsAre(*parse_peer("239.255.42.99:1511"), *parse_peer("224.0.0.1:9000")));
  EXPECT_THAT(config.listeners(), ElementsAre(*parse_peer("10.0.0.7:1511")));
  config.multicast = false;
  EXPECT_THAT(config.groups(), ElementsAre(*parse_peer("224.0.0.1:9000")));
  config.address = "0.0.0.0";
  EXPECT_THAT(faults(config), ElementsAre("streaming.natnet.multicast_interface"));
  config.multicast_interface = "10.0.0.5";
  EXPECT_THAT(faults(config), IsEmpty());
}

}  // namespace
}  // namespace fiducap::natnet
