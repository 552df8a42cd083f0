#include <gmock/gmock.h>

#include "tools/doctor/doctor.hpp"

namespace fiducap {
namespace {

using testing::AllOf;
using testing::Each;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const std::vector<NetworkInterface> kLab{{"lo", "127.0.0.1", true, true, false},
                                         {"eth0", "10.0.0.5", true, false, true}};

auto has(Grade grade, const char* text, const char* remedy = "") {
  return testing::Contains(AllOf(Field(&Finding::grade, grade),
                                 Field(&Finding::text, HasSubstr(text)),
                                 Field(&Finding::remedy, HasSubstr(remedy))));
}

/// A server without faults: two bodies on four cores, a token, a store.
class ServerFindings : public testing::Test {
 protected:
  ServerFindings() {
    config_.bodies.resize(2);
    facts_.token.length = 24;
    config_.map.store = "hall.map";
    facts_.machine = {4, "performance", 99, 8 << 20, 8 << 20, true, "active"};
    facts_.servers = {{4711, true}};
    facts_.store = StoreFacts{
        "hall.map", true, true, "process 4711", "", {}, {"/var", true, std::uint64_t{500} << 30}};
    facts_.recordings = {"recordings", true, std::uint64_t{500} << 30};
  }
  [[nodiscard]] Findings all(const std::vector<NetworkInterface>& interfaces = kLab) const {
    Findings all;
    for (const Findings& part :
         {exposure_findings(config_, facts_, interfaces), machine_findings(config_, facts_),
          disk_findings(config_, facts_), port_findings(config_, facts_), loss_findings(facts_)})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }
  void expect(Grade grade, const char* text, const char* remedy = "") const {
    EXPECT_THAT(all(), has(grade, text, remedy));
  }
  void expect_none(Grade grade, const char* text) const {
    EXPECT_THAT(all(), Not(has(grade, text)));
  }
  auto& natnet() { return enabled(config_.streaming.natnet); }
  auto& vrpn() { return enabled(config_.streaming.vrpn); }
  auto& machine() { return facts_.machine; }

  ServerConfig config_;
  ServerFacts facts_;

 private:
  template <typename Protocol>
  static Protocol& enabled(Protocol& protocol) {
    protocol.enabled = true;
    return protocol;
  }
};

TEST_F(ServerFindings, AreAllOkForAGoodServer) {
  EXPECT_THAT(all(), AllOf(Not(IsEmpty()), Each(Field(&Finding::grade, Grade::kOk))));
}

TEST_F(ServerFindings, HaveARemedyForEveryFault) {
  facts_.token.length = 0;
  natnet().remote_control = RemoteControl::kAll;
  config_.streaming.dds.enabled = true;
  config_.dds.interface = "";
  config_.bodies.resize(9);
  machine() = {1, "powersave", 0, 1, 1, false, "failed"};
  facts_.servers = {{1, false}};
  facts_.store = StoreFacts{"m", true, false, "process 2", "", {"version 3: bad"}, {"/", true, 5}};
  facts_.recordings = {"r", false, 5};
  int wrong = 0;
  for (const Finding& one : all()) {
    if (one.grade == Grade::kOk) continue;
    ++wrong;
    EXPECT_FALSE(one.remedy.empty()) << one.text;
  }
  EXPECT_GT(wrong, 12);
}

TEST_F(ServerFindings, ReportAnImuWithoutAPeer) {
  auto& imu = config_.bodies[1].imu_source.emplace();
  config_.bodies[1].name = "drone";
  imu.line.port = 5005;
  constexpr const char* kFirst = "the IMU of drone on UDP port 5005 belongs to the first sender";
  expect(Grade::kWarning, kFirst, "imu_source.peer");
  imu.line.address = "127.0.0.1";
  expect_none(Grade::kWarning, kFirst);
  imu.type = ImuSourceType::kMavlink;
  imu.mavlink.link.port = 5005;
  expect(Grade::kWarning, kFirst);
  imu.mavlink.link.peer = "10.0.0.9";
  expect_none(Grade::kWarning, kFirst);
}

TEST_F(ServerFindings, ListTheAddressesOfEachProtocol) {
  natnet().address = "0.0.0.0";
  natnet().networks = {"10.1.0.0/16"};
  vrpn().address = "10.0.0.5";
  expect(Grade::kOk, "attached to, 10.1.0.0/16");
  expect(Grade::kOk, "vrpn on 10.0.0.5 is open to all machines that reach the port");
  vrpn().address = "127.0.0.1";
  expect(Grade::kOk, "vrpn is for this machine only");
  config_.streaming.web.enabled = true;
  config_.streaming.web.address = "0.0.0.0";
  expect(Grade::kOk, "web on 0.0.0.0 is open to all machines");
}

TEST_F(ServerFindings, WarnOfForgedNatNetClientsUntilTheyAreNamed) {
  natnet().address = "10.0.0.5";
  expect(Grade::kWarning, "also when a datagram forges it", "streaming.natnet.clients");
  natnet().clients = {"10.0.0.7", "10.1.0.0/16"};
  expect_none(Grade::kWarning, "forges");
  expect(Grade::kOk, "natnet on 10.0.0.5 is open to this machine and 10.0.0.7, 10.1.0.0/16");
  natnet() = {.enabled = true};
  expect_none(Grade::kWarning, "forges");
}

TEST_F(ServerFindings, NameProgramsThatLoseDatagrams) {
  facts_.listening = {{Transport::kUdp, "127.0.0.1", 1511, 7, "python3 (process 812)", 356},
                      {Transport::kUdp, "127.0.0.1", 1512, 8, "python3 (process 813)", 0}};
  expect(Grade::kWarning, "python3 (process 812) at UDP port 1511 has lost 356 datagrams",
         "SO_RCVBUF");
  expect_none(Grade::kWarning, "process 813");
}

TEST_F(ServerFindings, WarnOfExposure) {
  auto interfaces = kLab;
  interfaces.push_back({"wan", "93.184.216.34", true, false, true});
  vrpn().address = "0.0.0.0";
  EXPECT_THAT(all(interfaces),
              has(Grade::kWarning, "93.184.216.34 (wan)", "streaming.vrpn.address"));
  vrpn().address = "10.0.0.5";
  EXPECT_THAT(all(interfaces), Not(has(Grade::kWarning, "vrpn")));
  natnet().remote_control = RemoteControl::kLoopback;
  expect(Grade::kWarning, "natnet clients of this machine may", "remote_control: off");
  natnet().networks = {"0.0.0.0/0"};
  expect(Grade::kFault, "natnet trusts 0.0.0.0/0", "streaming.natnet.networks");
  config_.streaming.dds.enabled = true;
  expect_none(Grade::kWarning, "dds");
  config_.dds.interface = "eth0";
  expect(Grade::kWarning, "dds on eth0", "dds.interface");
  facts_.token.length = 8;
  expect(Grade::kWarning, "has 8 characters", "openssl");
  facts_.token.length = 0;
  expect(Grade::kWarning, "no operator's token", "openssl");
  facts_.token.unreadable = "token: Permission denied";
  expect(Grade::kWarning, "Permission denied", "run doctor as");
}

TEST_F(ServerFindings, WarnOfASlowMachine) {
  machine().cores = 1;
  machine().governor = "powersave";
  expect(Grade::kWarning, "2 bodies on 1 cores");
  expect(Grade::kWarning, "powersave", "performance");
  machine().receive_buffer_most = machine().send_buffer_most = 212'992;
  machine().clock_synchronised = false;
  expect(Grade::kWarning, "rmem_max is 212992", "sysctl");
  expect(Grade::kWarning, "wmem_max is 212992", "sysctl");
  expect(Grade::kWarning, "not synchronised", "chrony");
  facts_.servers.front().realtime = false;
  expect(Grade::kWarning, "process 4711", "LimitRTPRIO");
  facts_.servers.clear();
  machine().realtime_most = 0;
  expect(Grade::kWarning, "started from here", "limits.d");
  machine().realtime_most = 10;
  expect_none(Grade::kWarning, "priority");
}

TEST_F(ServerFindings, IgnoreUnknownFacts) {
  machine() = {};
  machine().cores = 4;
  EXPECT_THAT(machine_findings(config_, facts_), Each(Field(&Finding::grade, Grade::kOk)));
}

TEST_F(ServerFindings, ReportTheUnit) {
  machine().unit = "failed";
  expect(Grade::kFault, "has failed", "journalctl");
  machine().unit = "inactive";
  expect(Grade::kWarning, "outside of its unit");
  facts_.servers.clear();
  expect(Grade::kWarning, "is inactive", "systemctl enable");
}

TEST_F(ServerFindings, ReportTheStore) {
  StoreFacts& store = *facts_.store;
  store.damage = {"version 7: is damaged"};
  expect(Grade::kFault, "version 7", "fiducap map repair --store hall.map");
  store.damage.clear();
  store.unreadable = "is no database";
  expect(Grade::kFault, "is no database", "fiducap map repair");
  store.unreadable.clear();
  store.writable = false;
  expect(Grade::kFault, "cannot be written", "map.store");
  store.writable = true;
  store.folder.free_bytes = 300'000'000;
  expect(Grade::kWarning, "300 MB left", "make room");
  store.folder.free_bytes = 3'000'000;
  expect(Grade::kFault, "3 MB left", "make room");
  facts_.servers.clear();
  expect(Grade::kWarning, "held by process 4711", "end that one");
  facts_.store.reset();
  config_.map.store.clear();
  expect(Grade::kWarning, "is lost when the server ends", "map.store");
}

TEST_F(ServerFindings, GiveTheDiskSpaceForRecordingsInMinutes) {
  config_.bodies.resize(1);
  config_.bodies[0].cameras.resize(1);
  CameraMount& mount = config_.bodies[0].cameras[0].mount;
  mount.model.width = 1000;
  mount.model.height = 1000;
  mount.rate_hz = 100;
  EXPECT_DOUBLE_EQ(recording_rate(config_), 200 * 150.0 + 100 * 1500.0);
  config_.recorder.images = true;
  EXPECT_DOUBLE_EQ(recording_rate(config_), 200 * 150.0 + 100 * 500'000.0);
  facts_.recordings.free_bytes = 30'018'000'000;  // ten minutes
  expect(Grade::kWarning, "about 10 min", "recorder.folder");
  facts_.recordings.writable = false;
  expect(Grade::kFault, "cannot be written", "recorder.folder");
}

TEST_F(ServerFindings, ReportAPortOfAnotherProgram) {
  const auto port = static_cast<std::uint16_t>(vrpn().port);
  facts_.listening = {{Transport::kTcp, "0.0.0.0", port, 1, "fiducapd (process 4711)"}};
  EXPECT_THAT(port_findings(config_, facts_), IsEmpty());
  facts_.listening.front().owner = "vrpn_server (process 812)";
  expect(Grade::kFault, "used by vrpn_server (process 812)", "set streaming.vrpn.port");
  facts_.listening.front().owner.clear();
  EXPECT_THAT(port_findings(config_, facts_), IsEmpty()) << "the owner is not known";
}

}  // namespace
}  // namespace fiducap
