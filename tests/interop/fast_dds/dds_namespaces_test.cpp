// Two machines: a network namespace each, joined by a cable on which multicast does not pass. Only
// peers find each other.
#include <gmock/gmock.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "peer_process.hpp"
#include "streaming/dds/dds.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::dds {
namespace {

using testing::StartsWith;

constexpr int kDomain = 46;
constexpr const char* kOurs = "10.77.46.1";
constexpr const char* kTheirs = "10.77.46.2";

/// Two ends of a pipe between a child that waits and a parent that lets it go on.
class Gate final {
 public:
  Gate() { EXPECT_EQ(::pipe(ends_), 0); }
  ~Gate() {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;
  void open() const { EXPECT_EQ(::write(ends_[1], "g", 1), 1); }
  [[nodiscard]] bool pass() const {
    char c = 0;
    return ::read(ends_[0], &c, 1) == 1 && c == 'g';
  }
  void refuse() const { EXPECT_EQ(::write(ends_[1], "x", 1), 1); }

 private:
  int ends_[2]{-1, -1};
};

bool run(const std::string& command) {
  return std::system((command + " >/dev/null 2>&1").c_str()) == 0;
}

std::string inside(pid_t pid, const std::string& command) {
  return "nsenter -t " + std::to_string(pid) + " -n " + command;
}

/// A child with a network of its own: says that it has one, waits for the cable, then does its work
/// and ends.
template <typename Work>
pid_t start_apart(const Gate& apart, const Gate& connected, Work&& work) {
  const pid_t pid = ::fork();
  if (pid != 0) return pid;
  if (::unshare(CLONE_NEWNET) != 0) {
    apart.refuse();
    ::_exit(77);
  }
  apart.open();
  if (!connected.pass()) ::_exit(1);
  ::_exit(work());
}

int serve_for(double seconds) {
  FakeClock clock;
  NetworkConfig network;
  network.domain = kDomain;
  network.interface = kOurs;
  network.peers = {kTheirs};
  const std::vector<std::string> bodies{"drone"};
  auto participant = Participant::open(network);
  if (!participant) return 2;
  auto server = start_dds_server([&participant] { return participant; }, {},
                                 make_scene_frame(bodies)->model, clock);
  if (!server) return 3;
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  publish_frames(**server, bodies, [end] { return std::chrono::steady_clock::now() < end; });
  return 0;
}

// Fast DDS looks at interfaces once, when it starts; the kernel takes up to a second to call a
// cable plugged in.
const std::string kUntilUp =
    "sh -c 'for i in $(seq 100); do ip link show cable | grep -q \"state UP\" && exit 0; sleep "
    "0.05; done; exit 1'";

bool connect(pid_t ours, pid_t theirs) {
  return run(inside(ours, "ip link set lo up")) && run(inside(theirs, "ip link set lo up")) &&
         run(inside(ours, "ip link add cable type veth peer name cable netns " +
                              std::to_string(theirs))) &&
         run(inside(ours, std::string("ip address add ") + kOurs + "/24 dev cable")) &&
         run(inside(theirs, std::string("ip address add ") + kTheirs + "/24 dev cable")) &&
         run(inside(ours, "ip link set cable up multicast off")) &&
         run(inside(theirs, "ip link set cable up multicast off")) && run(inside(ours, kUntilUp)) &&
         run(inside(theirs, kUntilUp));
}

// Their machine goes two seconds before our server ends, and takes the cable with it: the server
// ends all the same.
TEST(FastDdsAcrossNamespaces, IsFoundByPeersWithoutMulticast) {
  const Gate ours_apart;
  const Gate theirs_apart;
  const Gate ours_connected;
  const Gate theirs_connected;
  const pid_t server = start_apart(ours_apart, ours_connected, [] { return serve_for(9); });
  if (!ours_apart.pass()) {
    ::waitpid(server, nullptr, 0);
    GTEST_SKIP() << "network namespaces are not permitted here (needs CAP_SYS_ADMIN)";
  }
  PeerProcess peer({"read", std::to_string(kDomain), kTheirs, kOurs, "7",
                    "PoseStamped:rt/drone/pose", "TFMessage:rt/tf_static:k", "Body:fiducap/bodies"},
                   [&] {
                     if (::unshare(CLONE_NEWNET) != 0) ::_exit(77);
                     theirs_apart.open();
                     if (!theirs_connected.pass()) ::_exit(1);
                   });
  ASSERT_TRUE(theirs_apart.pass());
  const bool cable = connect(server, peer.pid());
  ours_connected.open();
  theirs_connected.open();
  auto heard = peer.heard();
  int status = 0;
  ASSERT_EQ(::waitpid(server, &status, 0), server);
  if (!cable) GTEST_SKIP() << "no veth between namespaces here (needs iproute2 and CAP_NET_ADMIN)";
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_GE(heard["rt/drone/pose"].count, 200);
  EXPECT_THAT(heard["rt/drone/pose"].last, StartsWith("frame=world p=1,-2,0.5 "));
  EXPECT_EQ(heard["rt/tf_static"].count, 1);
  EXPECT_GE(heard["fiducap/bodies"].count, 200);
}

}  // namespace
}  // namespace fiducap::dds
