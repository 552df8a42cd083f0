#include <gmock/gmock.h>
#include <unistd.h>

#include <array>
#include <thread>

#include "mapping/store/map_store.hpp"
#include "support/command_run.hpp"
#include "support/loopback_socket.hpp"
#include "support/results.hpp"
#include "support/temporary_folder.hpp"
#include "tools/doctor/doctor.hpp"

namespace fiducap {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::ElementsAre;
using testing::Field;
using testing::FieldsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::vector<NetworkInterface> kInterfaces{{"lo", "127.0.0.1", true, true, false},
                                                {"eth0", "10.0.0.5", true, false, true}};

TEST(Doctor, FindsPortsWithoutAListener) {
  const auto faults = [](const std::string& address, const std::vector<ListeningPort>& listening) {
    const ServedProtocol vrpn{"vrpn", true, address, {{3883, false}, {3883, true}}, {}};
    return faults_of(vrpn, listening, kInterfaces);
  };
  const std::vector<ListeningPort> all{{Transport::kTcp, "0.0.0.0", 3883},
                                       {Transport::kUdp, "0.0.0.0", 3883}};
  EXPECT_THAT(faults("0.0.0.0", all), IsEmpty());
  EXPECT_THAT(faults("10.0.0.6", all), ElementsAre(HasSubstr("set streaming.vrpn.address")));
  EXPECT_THAT(faults("127.0.0.1", {{Transport::kTcp, "127.0.0.1", 3883}, all[1]}), IsEmpty());
  EXPECT_THAT(faults("127.0.0.1",
                     {{Transport::kTcp, "10.0.0.5", 3883}, {Transport::kUdp, "127.0.0.1", 3884}}),
              ElementsAre(HasSubstr("no program listens on 3883 tcp"),
                          HasSubstr("no program listens on 3883 udp")));
}

TEST(Doctor, FindsParticipantsByTheirPorts) {
  dds::NetworkConfig network;
  network.domain = 2;  // ports from 7400 + 2 · 250 + 10 = 7910 on
  network.max_participants = 3;
  const auto faults_at = [&](std::uint16_t port, Transport transport = Transport::kUdp) {
    ServerFacts facts;
    facts.listening = {{transport, "0.0.0.0", port}};
    return faults_of(network, facts, kInterfaces);
  };
  EXPECT_THAT(faults_at(7910), IsEmpty());
  EXPECT_THAT(faults_at(7914), IsEmpty());
  const auto none = ElementsAre(HasSubstr("no program listens on 7910 udp"));
  EXPECT_THAT(faults_at(7908), none);
  EXPECT_THAT(faults_at(7911), none) << "a data port";
  EXPECT_THAT(faults_at(7916), none) << "of a fourth participant";
  EXPECT_THAT(faults_at(7910, Transport::kTcp), none);
}

TEST(Doctor, FindsAMissingDdsInterface) {
  dds::NetworkConfig network;
  ServerFacts facts;
  facts.listening = {{Transport::kUdp, "0.0.0.0", 7410}};
  network.interface = "wlan7";
  EXPECT_THAT(faults_of(network, facts, kInterfaces), ElementsAre(HasSubstr("set dds.interface")));
  for (const char* good : {"eth0", "10.0.0.5", ""}) {
    network.interface = good;
    EXPECT_THAT(faults_of(network, facts, kInterfaces), IsEmpty()) << good;
  }
}

TEST(Doctor, IsNotSatisfiedWithDdsThatLocalProgramsDoNotFind) {
  ServerFacts facts;
  facts.listening = {{Transport::kUdp, "0.0.0.0", 7410}};
  facts.dds_found = true;
  EXPECT_THAT(faults_of(dds::NetworkConfig{}, facts, kInterfaces), IsEmpty());
  facts.dds_found = false;
  EXPECT_THAT(faults_of(dds::NetworkConfig{}, facts, kInterfaces),
              ElementsAre(HasSubstr("ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST")));
}

TEST(Doctor, ReadsHowManyDatagramsASocketHasLost) {
  const auto port = listening_port_of(
      " 120: 0100007F:05E7 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 "
      "4711 2 0000000000000000 356",
      Transport::kUdp);
  ASSERT_TRUE(port);
  EXPECT_EQ(port->inode, 4711U);
  EXPECT_EQ(port->discarded, 356U);
}

TEST(Doctor, ReadsTheKernelsListOfSockets) {
  const auto read = [](const char* line) {
    const auto port = listening_port_of(line, Transport::kTcp);
    return port ? port->address + " " + std::to_string(port->port) : "none";
  };
  EXPECT_EQ(read("   0: 0100007F:0F2B 00000000:0000 0A 00000000:00000000 00:00000000 00000000     "
                 "0        0 1 1"),
            "127.0.0.1 3883");
  EXPECT_EQ(read(" 1: 00000000000000000000000000000000:1F90 "
                 "00000000000000000000000000000000:0000 0A 0 0 0 0 0"),
            ":: 8080");
  EXPECT_EQ(read("  sl  local_address rem_address   st tx_queue"), "none");
  EXPECT_EQ(read("   0: 0100007F:0F2B 0100007F:D431 01 0"), "none") << "a connection";
  EXPECT_EQ(read("   0: 0100007Z:0F2B 00000000:0000 0A 0"), "none");
  EXPECT_FALSE(listening_port_of("", Transport::kUdp));
}

TEST(Doctor, FailsWithoutAServer) {
  const std::vector<std::string> set{
      "streaming.vrpn.enabled=false", "streaming.natnet.enabled=true",
      "streaming.natnet.when_invalid=stop", "streaming.vicon.enabled=true"};
  const auto run = on_terminal([&](const Terminal& terminal) {
    return run_doctor({"", set, "127.0.0.1:9"}, terminal);
  });
  EXPECT_EQ(run.code, kExitFailed);
  EXPECT_THAT(run.out, AllOf(HasSubstr("no answer"), HasSubstr("vrpn: switched off"),
                             HasSubstr("attitude wxyz"), HasSubstr("dds: switched off"),
                             HasSubstr("a body that is lost: absent (when_invalid: stop)"),
                             HasSubstr("a body that is lost: occluded")));
}

/// Listens on a free port of this machine.
class Listener final {
 public:
  Listener() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const sockaddr_in any = loopback(0);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&any), sizeof any), 0);
    EXPECT_EQ(::listen(fd_, 4), 0);
  }
  ~Listener() { ::close(fd_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  [[nodiscard]] std::uint16_t port() const { return port_of(fd_); }
  /// Accepts one connection, reads a part of the request, replies, ends it.
  void reply_once(const std::string& reply) const {
    const int peer = ::accept(fd_, nullptr, nullptr);
    std::array<char, 4096> request{};
    EXPECT_GT(::recv(peer, request.data(), request.size(), 0), 0);
    EXPECT_EQ(::send(peer, reply.data(), reply.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(reply.size()));
    ::close(peer);
  }

 private:
  int fd_;
};

TEST(HttpGet, ReturnsTheBodyOrTheFault) {
  const auto get = [](const std::string& reply) {
    const Listener listener;
    const std::jthread server([&] { listener.reply_once(reply); });
    return http_get("127.0.0.1", listener.port(), "/api/v1/state", 5s);
  };
  EXPECT_EQ(value_of(get("HTTP/1.1 200 OK\r\nA: b\r\n\r\n{\"x\":1}")), "{\"x\":1}");
  EXPECT_THAT(error_of(get("HTTP/1.1 421 Misdirected\r\n\r\n")), HasSubstr("421"));
  EXPECT_THAT(error_of(get("SSH-2.0-x\r\n")), HasSubstr("does not speak HTTP"));
  const Listener silent;
  EXPECT_FALSE(http_get("127.0.0.1", silent.port(), "/", 50ms)) << "ends by its timeout";
  EXPECT_FALSE(http_get("no such host.invalid", 1, "/", 50ms));
}

TEST(ServerFacts, HaveTheAlarmsOfTheServer) {
  for (const char* text : {"", "{}", "[]", "not json", "{\"events\":3}", "{\"events\":[1,null]}",
                           "{\"events\":{\"standing\":{}}}"})
    EXPECT_TRUE(alarms_in(text).empty()) << text;
  const std::string list =
      R"([{"subject":"map","severity":"error","text":"not stored","remedy":"make room"},
          {"subject":"drone","severity":"warning","text":"coasts","remedy":"show it a tag"},
          {"subject":"clock","severity":"info","text":"was set"}])";
  for (const std::string& json :
       {R"({"events":)" + list + "}", R"({"events":{"standing":)" + list + "}}"}) {
    EXPECT_THAT(alarms_in(json),
                ElementsAre(FieldsAre(Grade::kFault, "map: not stored", "make room"),
                            FieldsAre(Grade::kWarning, "drone: coasts", "show it a tag"),
                            FieldsAre(Grade::kOk, "clock: was set", "")));
  }
}

TEST(ServerFacts, DescribeThisMachine) {
  const TemporaryFolder folder;
  ServerConfig config;
  config.streaming.web.enabled = false;
  config.map.store = folder.file("hall.map");
  config.recorder.folder = folder.file("not/yet/there");
  config.operators.token = "four and twenty";
  const Listener listener;
  const std::string process = "process " + std::to_string(::getpid());
  auto facts = gather_facts(config, "127.0.0.1");
  EXPECT_GT(facts.machine.cores, 0);
  EXPECT_EQ(facts.token.length, 15u);
  ASSERT_TRUE(facts.store);
  EXPECT_FALSE(facts.store->exists);
  EXPECT_TRUE(facts.store->writable);
  EXPECT_TRUE(facts.recordings.writable);
  EXPECT_TRUE(facts.recordings.free_bytes);
  EXPECT_THAT(facts.listening, testing::Contains(AllOf(
                                   Field(&ListeningPort::port, listener.port()),
                                   Field(&ListeningPort::owner, HasSubstr("(" + process + ")")))));

  auto store = value_of(MapStore::open(config.map.store));
  ASSERT_TRUE(store.claim());
  facts = gather_facts(config, "127.0.0.1");
  EXPECT_TRUE(facts.store->exists);
  EXPECT_EQ(facts.store->holder, process);
  EXPECT_TRUE(facts.store->damage.empty());
  EXPECT_EQ(facts.store->unreadable, "");

  config.map.store = folder.write("garbage", std::string(5000, 'x'));
  EXPECT_NE(gather_facts(config, "127.0.0.1").store->unreadable, "");
}

}  // namespace
}  // namespace fiducap
