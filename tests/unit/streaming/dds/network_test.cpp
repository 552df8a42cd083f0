#include "middleware/network.hpp"

#include <gmock/gmock.h>

namespace fiducap::dds {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

TEST(DdsNetwork, DefaultIsThisMachineAloneWithoutMulticast) {
  const NetworkConfig config;
  EXPECT_THAT(config.check(), IsEmpty());
  EXPECT_FALSE(config.uses_multicast());
  const std::string xml = cyclone_xml(config, true);
  EXPECT_THAT(xml, HasSubstr("name=\"lo\""));
  EXPECT_THAT(xml, HasSubstr("<AllowMulticast>false<"));
  EXPECT_THAT(xml, HasSubstr("<Peer Address=\"127.0.0.1\"/>"));
}

TEST(DdsNetwork, AnotherInterfaceIsSearchedByMulticastUnlessPeersAreNamed) {
  NetworkConfig config;
  config.interface = "eth0";
  EXPECT_TRUE(config.uses_multicast());
  EXPECT_THAT(cyclone_xml(config, true), HasSubstr("<AllowMulticast>spdp<"));
  config.peers = {"192.168.1.7", "robot.local"};
  EXPECT_FALSE(config.uses_multicast());
  EXPECT_THAT(cyclone_xml(config, true),
              HasSubstr("<Peer Address=\"192.168.1.7\"/><Peer Address=\"robot.local\"/>"));
}

TEST(DdsNetwork, AnAddressStandsForItsInterface) {
  NetworkConfig config;
  config.interface = "192.168.1.5";
  EXPECT_THAT(cyclone_xml(config, true), HasSubstr("address=\"192.168.1.5\""));
}

TEST(DdsNetwork, NothingLeavesTheAttachedNetworksUnlessAPeerIsBeyond) {
  EXPECT_THAT(cyclone_xml({}, true), HasSubstr("<DontRoute>true<"));
  EXPECT_THAT(cyclone_xml({}, false), HasSubstr("<DontRoute>false<"));
}

TEST(DdsNetwork, WhatWouldEndAnAttributeIsRefused) {
  NetworkConfig config;
  config.interface = "lo\"/><Evil x=\"";
  config.peers = {"a b", "<x>"};
  config.domain = 233;
  EXPECT_THAT(config.check(), SizeIs(4));
}

TEST(DdsNetwork, LongMessagesAreRefusedByTheMiddleware) {
  EXPECT_THAT(cyclone_xml({}, true),
              HasSubstr("<MaxSampleSize>" + std::to_string(kMaxMessage) + "B<"));
}

}  // namespace
}  // namespace fiducap::dds
