#include "tools/doctor/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace fiducap {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::vector<NetworkInterface> kInterfaces{{"lo", "127.0.0.1", true, true, false},
                                                {"eth0", "10.0.0.5", true, false, true}};
ServedProtocol vrpn_on(const std::string& address) {
  return {"vrpn", true, address, {{3883, false}, {3883, true}}, {}};
}

TEST(Doctor, FindsNothingWrongWithAPortThatIsHeard) {
  const std::vector<ListeningPort> listening{{Transport::kTcp, "127.0.0.1", 3883},
                                             {Transport::kUdp, "0.0.0.0", 3883}};
  EXPECT_THAT(faults_of(vrpn_on("127.0.0.1"), listening, kInterfaces), IsEmpty());
}

TEST(Doctor, NamesEachPortThatNobodyHears) {
  const std::vector<ListeningPort> listening{{Transport::kTcp, "10.0.0.5", 3883},
                                             {Transport::kUdp, "127.0.0.1", 3884}};
  EXPECT_THAT(faults_of(vrpn_on("127.0.0.1"), listening, kInterfaces),
              ElementsAre(HasSubstr("no program listens on 3883 tcp"),
                          HasSubstr("no program listens on 3883 udp")));
}

TEST(Doctor, NamesAnAddressOfAnotherMachine) {
  const std::vector<ListeningPort> listening{{Transport::kTcp, "0.0.0.0", 3883},
                                             {Transport::kUdp, "0.0.0.0", 3883}};
  EXPECT_THAT(faults_of(vrpn_on("10.0.0.6"), listening, kInterfaces),
              ElementsAre(HasSubstr("set streaming.vrpn.address")));
  EXPECT_THAT(faults_of(vrpn_on("0.0.0.0"), listening, kInterfaces), IsEmpty());
}

TEST(Doctor, FindsAParticipantOfTheDomainAtItsPort) {
  dds::NetworkConfig network;
  network.domain = 2;  // ports from 7400 + 2 · 250 + 10 = 7910 on
  network.max_participants = 3;
  const auto faults_at = [&](std::uint16_t port, Transport transport = Transport::kUdp) {
    return faults_of(network, {{transport, "0.0.0.0", port}}, kInterfaces);
  };
  EXPECT_THAT(faults_at(7910), IsEmpty());
  EXPECT_THAT(faults_at(7914), IsEmpty());
  const auto nobody = ElementsAre(HasSubstr("no program listens on 7910 udp"));
  EXPECT_THAT(faults_at(7908), nobody);
  EXPECT_THAT(faults_at(7911), nobody) << "a data port";
  EXPECT_THAT(faults_at(7916), nobody) << "of a fourth participant";
  EXPECT_THAT(faults_at(7910, Transport::kTcp), nobody);
}

TEST(Doctor, NamesADdsInterfaceThatIsNotThere) {
  dds::NetworkConfig network;
  network.interface = "wlan7";
  const std::vector<ListeningPort> listening{{Transport::kUdp, "0.0.0.0", 7410}};
  EXPECT_THAT(faults_of(network, listening, kInterfaces),
              ElementsAre(HasSubstr("set dds.interface")));
  for (const char* good : {"eth0", "10.0.0.5", ""}) {
    network.interface = good;
    EXPECT_THAT(faults_of(network, listening, kInterfaces), IsEmpty()) << good;
  }
}

TEST(Doctor, ReadsTheKernelsListOfSockets) {
  const auto tcp = listening_port_of(
      "   0: 0100007F:0F2B 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 "
      "1 1",
      Transport::kTcp);
  ASSERT_TRUE(tcp);
  EXPECT_EQ(tcp->address, "127.0.0.1");
  EXPECT_EQ(tcp->port, 3883);
  const auto any6 = listening_port_of(
      " 1: 00000000000000000000000000000000:1F90 00000000000000000000000000000000:0000 0A 0 0 0 0 "
      "0",
      Transport::kTcp);
  ASSERT_TRUE(any6);
  EXPECT_EQ(any6->address, "::");
  EXPECT_FALSE(listening_port_of("  sl  local_address rem_address   st tx_queue", Transport::kTcp));
  EXPECT_FALSE(listening_port_of("   0: 0100007F:0F2B 0100007F:D431 01 0", Transport::kTcp))
      << "a connection";
  EXPECT_FALSE(listening_port_of("   0: 0100007Z:0F2B 00000000:0000 0A 0", Transport::kTcp));
  EXPECT_FALSE(listening_port_of("", Transport::kUdp));
}

TEST(Doctor, EndsWithOneWhenNoServerAnswersAndSaysSo) {
  std::ostringstream out;
  std::ostringstream err;
  const Terminal terminal{out, err};
  EXPECT_EQ(run_doctor({"",
                        {"streaming.vrpn.enabled=false", "streaming.natnet.enabled=true",
                         "streaming.natnet.when_invalid=stop", "streaming.vicon.enabled=true"},
                        "127.0.0.1:9"},
                       terminal),
            kExitFailed);
  EXPECT_THAT(out.str(), HasSubstr("no answer"));
  EXPECT_THAT(out.str(), HasSubstr("vrpn: switched off"));
  EXPECT_THAT(out.str(), HasSubstr("attitude wxyz"));
  EXPECT_THAT(out.str(), HasSubstr("dds: switched off"));
  EXPECT_THAT(out.str(), HasSubstr("a body that is lost: absent (when_invalid: stop)"));
  EXPECT_THAT(out.str(), HasSubstr("a body that is lost: occluded"));
}

}  // namespace
}  // namespace fiducap
