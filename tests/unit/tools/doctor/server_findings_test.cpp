#include "tools/doctor/doctor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using Grade = Finding::Grade;

const std::vector<NetworkInterface> kLab{{"lo", "127.0.0.1", true, true, false},
                                         {"eth0", "10.0.0.5", true, false, true}};

auto has(Grade grade, const char* text, const char* remedy = "") {
  return Contains(AllOf(Field(&Finding::grade, grade), Field(&Finding::text, HasSubstr(text)),
                        Field(&Finding::remedy, HasSubstr(remedy))));
}

/// A server in order: two bodies on four cores, a token, a store.
struct Sound {
  Sound() {
    config.bodies.resize(2);
    facts.token.length = 24;
    config.map.store = "hall.map";
    facts.machine = {4, "performance", 99, 8 << 20, 8 << 20, true, "active"};
    facts.servers = {{4711, true}};
    facts.store = StoreFacts{
        "hall.map", true, true, "process 4711", "", {}, {"/var", true, std::uint64_t{500} << 30}};
    facts.recordings = {"recordings", true, std::uint64_t{500} << 30};
  }
  [[nodiscard]] Findings all(const std::vector<NetworkInterface>& interfaces = kLab) const {
    Findings all;
    for (const Findings& part :
         {exposure_findings(config, facts, interfaces), machine_findings(config, facts),
          disk_findings(config, facts), port_findings(config, facts), alarm_findings(facts)})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }
  ServerConfig config;
  ServerFacts facts;
};

TEST(ServerFindings, NothingIsWrongWithASoundServer) {
  const auto all = Sound().all();
  EXPECT_FALSE(all.empty());
  for (const Finding& one : all) EXPECT_EQ(one.grade, Grade::kOk) << one.text;
}

TEST(ServerFindings, WhateverIsWrongHasARemedy) {
  Sound lab;
  lab.facts.token.length = 0;
  lab.config.streaming.natnet.enabled = true;
  lab.config.streaming.natnet.remote_control = RemoteControl::kAll;
  lab.config.streaming.dds.enabled = true;
  lab.config.dds.interface = "";
  lab.config.bodies.resize(9);
  lab.facts.machine = {1, "powersave", 0, 1, 1, false, "failed"};
  lab.facts.servers = {{1, false}};
  lab.facts.store =
      StoreFacts{"m", true, false, "process 2", "", {"version 3: bad"}, {"/", true, 5}};
  lab.facts.recordings = {"r", false, 5};
  int wrong = 0;
  for (const Finding& one : lab.all()) {
    if (one.grade == Grade::kOk) continue;
    ++wrong;
    EXPECT_FALSE(one.remedy.empty()) << one.text;
  }
  EXPECT_GT(wrong, 12);
}

TEST(ServerFindings, SaysWhenAnImuBelongsToTheFirstSender) {
  Sound lab;
  auto& imu = lab.config.bodies[1].imu_source.emplace();
  lab.config.bodies[1].name = "drone";
  imu.line.port = 5005;
  constexpr const char* kFirst = "the IMU of drone on UDP port 5005 belongs to the first sender";
  EXPECT_THAT(lab.all(), has(Grade::kWarning, kFirst, "imu_source.peer"));
  imu.line.address = "127.0.0.1";
  EXPECT_THAT(lab.all(), Not(has(Grade::kWarning, kFirst)));
  imu.type = ImuSourceType::kMavlink;
  imu.mavlink.link.port = 5005;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, kFirst));
  imu.mavlink.link.peer = "10.0.0.9";
  EXPECT_THAT(lab.all(), Not(has(Grade::kWarning, kFirst)));
}

TEST(ServerFindings, SaysWhoMayListen) {
  Sound lab;
  lab.config.streaming.natnet.enabled = true;
  lab.config.streaming.natnet.address = "0.0.0.0";
  lab.config.streaming.natnet.networks = {"10.1.0.0/16"};
  lab.config.streaming.vrpn.enabled = true;
  lab.config.streaming.vrpn.address = "10.0.0.5";
  const auto all = lab.all();
  EXPECT_THAT(all, has(Grade::kOk, "attached to, 10.1.0.0/16"));
  EXPECT_THAT(all, has(Grade::kOk, "vrpn on 10.0.0.5 is open to all machines that reach the port"));
  lab.config.streaming.vrpn.address = "127.0.0.1";
  EXPECT_THAT(lab.all(), has(Grade::kOk, "vrpn is for this machine only"));
  lab.config.streaming.web.enabled = true;
  lab.config.streaming.web.address = "0.0.0.0";
  EXPECT_THAT(lab.all(), has(Grade::kOk, "web on 0.0.0.0 is open to all machines"));
}

TEST(ServerFindings, AnAddressOfTheInternetIsAWarning) {
  Sound lab;
  lab.config.streaming.vrpn.enabled = true;
  lab.config.streaming.vrpn.address = "0.0.0.0";
  auto interfaces = kLab;
  interfaces.push_back({"wan", "93.184.216.34", true, false, true});
  EXPECT_THAT(lab.all(interfaces),
              has(Grade::kWarning, "93.184.216.34 (wan)", "streaming.vrpn.address"));
  lab.config.streaming.vrpn.address = "10.0.0.5";
  EXPECT_THAT(lab.all(interfaces), Not(has(Grade::kWarning, "vrpn")));
}

TEST(ServerFindings, TrustInTheWholeInternetIsAFault) {
  Sound lab;
  lab.config.streaming.natnet.enabled = true;
  lab.config.streaming.natnet.networks = {"0.0.0.0/0"};
  EXPECT_THAT(lab.all(),
              has(Grade::kFault, "natnet trusts 0.0.0.0/0", "streaming.natnet.networks"));
}

TEST(ServerFindings, RemoteControlWithoutAPasswordIsAWarning) {
  Sound lab;
  lab.config.streaming.natnet.enabled = true;
  lab.config.streaming.natnet.remote_control = RemoteControl::kLoopback;
  EXPECT_THAT(lab.all(),
              has(Grade::kWarning, "natnet clients of this machine may", "remote_control: off"));
}

TEST(ServerFindings, DdsBeyondThisMachineIsAWarning) {
  Sound lab;
  lab.config.streaming.dds.enabled = true;
  EXPECT_THAT(lab.all(), Not(has(Grade::kWarning, "dds")));
  lab.config.dds.interface = "eth0";
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "dds on eth0", "dds.interface"));
}

TEST(ServerFindings, TheToken) {
  Sound lab;
  lab.facts.token.length = 8;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "has 8 characters", "openssl"));
  lab.facts.token.length = 0;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "no operator's token", "openssl"));
  lab.facts.token.unreadable = "token: Permission denied";
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "Permission denied", "run doctor as"));
}

TEST(ServerFindings, TheProcessor) {
  Sound lab;
  lab.facts.machine.cores = 1;
  lab.facts.machine.governor = "powersave";
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "2 bodies on 1 cores"));
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "powersave", "performance"));
}

TEST(ServerFindings, RealTimePriority) {
  Sound lab;
  lab.facts.servers.front().realtime = false;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "process 4711", "LimitRTPRIO"));
  lab.facts.servers.clear();
  lab.facts.machine.realtime_most = 0;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "started from here", "limits.d"));
  lab.facts.machine.realtime_most = 10;
  EXPECT_THAT(lab.all(), Not(has(Grade::kWarning, "priority")));
}

TEST(ServerFindings, BuffersAndClock) {
  Sound lab;
  lab.facts.machine.receive_buffer_most = 212'992;
  lab.facts.machine.send_buffer_most = 212'992;
  lab.facts.machine.clock_synchronised = false;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "rmem_max is 212992", "sysctl"));
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "wmem_max is 212992", "sysctl"));
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "not synchronised", "chrony"));
  lab.facts.machine = {};
  lab.facts.machine.cores = 4;
  for (const Finding& one : machine_findings(lab.config, lab.facts))
    EXPECT_EQ(one.grade, Grade::kOk) << "what the machine does not say: " << one.text;
}

TEST(ServerFindings, TheUnit) {
  Sound lab;
  lab.facts.machine.unit = "failed";
  EXPECT_THAT(lab.all(), has(Grade::kFault, "has failed", "journalctl"));
  lab.facts.machine.unit = "inactive";
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "outside of its unit"));
  lab.facts.servers.clear();
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "is inactive", "systemctl enable"));
}

TEST(ServerFindings, TheStore) {
  Sound lab;
  StoreFacts& store = *lab.facts.store;
  store.damage = {"version 7: is damaged"};
  EXPECT_THAT(lab.all(), has(Grade::kFault, "version 7", "fiducap map repair --store hall.map"));
  store.damage.clear();
  store.unreadable = "is no database";
  EXPECT_THAT(lab.all(), has(Grade::kFault, "is no database", "fiducap map repair"));
  store.unreadable.clear();
  store.writable = false;
  EXPECT_THAT(lab.all(), has(Grade::kFault, "cannot be written", "map.store"));
  store.writable = true;
  store.folder.free_bytes = 300'000'000;
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "300 MB left", "make room"));
  store.folder.free_bytes = 3'000'000;
  EXPECT_THAT(lab.all(), has(Grade::kFault, "3 MB left", "make room"));
  lab.facts.servers.clear();
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "held by process 4711", "end that one"));
  lab.facts.store.reset();
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "is lost when the server ends", "map.store"));
}

TEST(ServerFindings, RoomForRecordingsIsSaidInMinutes) {
  Sound lab;
  lab.config.bodies.resize(1);
  lab.config.bodies[0].cameras.resize(1);
  CameraMount& mount = lab.config.bodies[0].cameras[0].mount;
  mount.model.width = 1000;
  mount.model.height = 1000;
  mount.rate_hz = 100;
  EXPECT_DOUBLE_EQ(recording_rate(lab.config), 200 * 150.0 + 100 * 1500.0);
  lab.config.recorder.images = true;
  EXPECT_DOUBLE_EQ(recording_rate(lab.config), 200 * 150.0 + 100 * 500'000.0);
  lab.facts.recordings.free_bytes = 30'018'000'000;  // ten minutes
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "about 10 min", "recorder.folder"));
  lab.facts.recordings.writable = false;
  EXPECT_THAT(lab.all(), has(Grade::kFault, "cannot be written", "recorder.folder"));
}

TEST(ServerFindings, APortThatAnotherProgramHas) {
  Sound lab;
  lab.config.streaming.vrpn.enabled = true;
  const auto port = static_cast<std::uint16_t>(lab.config.streaming.vrpn.port);
  lab.facts.listening = {{Transport::kTcp, "0.0.0.0", port, 1, "fiducapd (process 4711)"}};
  EXPECT_THAT(port_findings(lab.config, lab.facts), IsEmpty());
  lab.facts.listening.front().owner = "vrpn_server (process 812)";
  EXPECT_THAT(lab.all(), has(Grade::kFault, "taken by vrpn_server (process 812)", "another port"));
  lab.facts.listening.front().owner.clear();
  EXPECT_THAT(port_findings(lab.config, lab.facts), IsEmpty()) << "nobody knows whose it is";
}

TEST(ServerFindings, AlarmsOfTheServer) {
  Sound lab;
  lab.facts.alarms = {{"map", "error", "the map is not stored", "make room"},
                      {"drone", "warning", "coasts", "show it a tag"},
                      {"clock", "info", "was set", ""}};
  EXPECT_THAT(lab.all(), has(Grade::kFault, "map: the map is not stored", "make room"));
  EXPECT_THAT(lab.all(), has(Grade::kWarning, "drone: coasts", "show it a tag"));
  EXPECT_THAT(lab.all(), has(Grade::kOk, "clock: was set"));
}

}  // namespace
}  // namespace fiducap
