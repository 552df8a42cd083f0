// No UDP socket outside the two that keep the rule of senders (middleware/net/networks.hpp).
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

/// File → why it may name such a socket.
const std::map<std::string, std::string> kMayOpen{
    {"server/capture/imu/byte_link.cpp", "the UDP socket of IMUs, under the rule"},
    {"server/streaming/net/bind.cpp", "the UDP socket of protocols, for udp_server"},
    {"server/streaming/net/bind.hpp", "the same"},
    {"server/streaming/net/udp_server.cpp", "the same"},
    {"server/middleware/network.cpp", "looks at those of Cyclone DDS, opens none"},
    {"server/daemon/watch/health_watch.cpp", "AF_UNIX, to systemd"},
    {"server/tools/doctor/network_check.cpp", "asks multicast of a card, in another process"}};

TEST(SocketsTest, EveryUdpSocketIsUnderTheRuleOfSenders) {
  int found = 0;
  for (const SourceFile& file : source_files({"server"})) {
    for (const std::string& line : file.lines) {
      const std::string code = code_of(line);
      const bool is_udp = code.find("SOCK_DGRAM") != std::string::npos ||
                          code.find("SOCK_RAW") != std::string::npos ||
                          code.find("udp::socket") != std::string::npos;
      if (!is_udp) continue;
      ++found;
      EXPECT_TRUE(kMayOpen.contains(file.path.generic_string()))
          << file.path << ": use net::UdpServer or ByteLink: " << line;
    }
  }
  EXPECT_GE(found, 6) << "the test did not find the sources";
}

}  // namespace
}  // namespace fiducap::test
