#include "app/cli/doctor_command.hpp"

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
ServedProtocol vrpn_on(const std::string& address) { return {"vrpn", true, address, {{3883, false}, {3883, true}}, {}}; }

TEST(Doctor, FindsNothingWrongWithAPortThatIsHeard) {
  const std::vector<ListeningPort> listening{{Transport::kTcp, "127.0.0.1", 3883}, {Transport::kUdp, "0.0.0.0", 3883}};
  EXPECT_THAT(faults_of(vrpn_on("127.0.0.1"), listening, kInterfaces), IsEmpty());
}

TEST(Doctor, NamesEachPortThatNobodyHears) {
  const std::vector<ListeningPort> listening{{Transport::kTcp, "10.0.0.5", 3883}, {Transport::kUdp, "127.0.0.1", 3884}};
  EXPECT_THAT(faults_of(vrpn_on("127.0.0.1"), listening, kInterfaces),
              ElementsAre(HasSubstr("nobody listens on 3883 tcp"), HasSubstr("nobody listens on 3883 udp")));
}

TEST(Doctor, NamesAnAddressOfAnotherMachine) {
  const std::vector<ListeningPort> listening{{Transport::kTcp, "0.0.0.0", 3883}, {Transport::kUdp, "0.0.0.0", 3883}};
  EXPECT_THAT(faults_of(vrpn_on("10.0.0.6"), listening, kInterfaces),
              ElementsAre(HasSubstr("set streaming.vrpn.address")));
  EXPECT_THAT(faults_of(vrpn_on("0.0.0.0"), listening, kInterfaces), IsEmpty());
}

TEST(Doctor, ReadsTheKernelsListOfSockets) {
  const auto tcp = listening_port_of(
      "   0: 0100007F:0F2B 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 1 1", Transport::kTcp);
  ASSERT_TRUE(tcp);
  EXPECT_EQ(tcp->address, "127.0.0.1");
  EXPECT_EQ(tcp->port, 3883);
  const auto any6 = listening_port_of(
      " 1: 00000000000000000000000000000000:1F90 00000000000000000000000000000000:0000 0A 0 0 0 0 0", Transport::kTcp);
  ASSERT_TRUE(any6);
  EXPECT_EQ(any6->address, "::");
  EXPECT_FALSE(listening_port_of("  sl  local_address rem_address   st tx_queue", Transport::kTcp));
  EXPECT_FALSE(listening_port_of("   0: 0100007F:0F2B 0100007F:D431 01 0", Transport::kTcp)) << "a connection";
  EXPECT_FALSE(listening_port_of("   0: 0100007Z:0F2B 00000000:0000 0A 0", Transport::kTcp));
  EXPECT_FALSE(listening_port_of("", Transport::kUdp));
}

TEST(Doctor, EndsWithOneWhenNoServerAnswersAndSaysSo) {
  std::ostringstream out;
  std::ostringstream err;
  const Terminal terminal{out, err};
  EXPECT_EQ(run_doctor({"", {"streaming.vrpn.enabled=false"}, "127.0.0.1:9"}, terminal), kExitFailed);
  EXPECT_THAT(out.str(), HasSubstr("no answer"));
  EXPECT_THAT(out.str(), HasSubstr("vrpn: switched off"));
  EXPECT_THAT(out.str(), HasSubstr("attitude wxyz"));
}

}  // namespace
}  // namespace fiducap
