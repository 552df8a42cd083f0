// A real VRPN client against our server, on loopback. Set FIDUCAP_VRPN_CLIENT to a `vrpn_print_devices` built from
// github.com/vrpn/vrpn; nothing of it is part of this project.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdlib>
#include <string>

#include "base/so3.hpp"
#include "streaming/vrpn/vrpn_server.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

extern char** environ;

namespace fiducap::vrpn {
namespace {

using testing::HasSubstr;
using testing::Not;

// Long enough for three of the client's two-second retries and its warning after 3 s without an answer.
constexpr auto kPatience = std::chrono::seconds(8);
constexpr auto kFramePeriod = std::chrono::milliseconds(10);

/// A child process whose output is read without waiting.
class ClientProcess final {
 public:
  ClientProcess(const std::string& program, const std::string& device) {
    int ends[2];
    EXPECT_EQ(::pipe2(ends, O_CLOEXEC | O_NONBLOCK), 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 2);
    posix_spawn_file_actions_addclosefrom_np(&actions, 3);  // or the client would keep our port open
    // Line by line: the client's own buffer is lost when it is ended.
    std::string arguments[] = {"stdbuf", "-oL", program, device};
    char* argv[] = {arguments[0].data(), arguments[1].data(), arguments[2].data(), arguments[3].data(), nullptr};
    EXPECT_EQ(::posix_spawnp(&pid_, "stdbuf", &actions, nullptr, argv, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    ::close(ends[1]);
    out_ = ends[0];
  }
  ~ClientProcess() {
    if (pid_ > 0) {
      ::kill(pid_, SIGTERM);
      ::waitpid(pid_, nullptr, 0);
    }
    ::close(out_);
  }
  ClientProcess(const ClientProcess&) = delete;
  ClientProcess& operator=(const ClientProcess&) = delete;

  /// All it has printed so far; the middle of a long output is left out.
  const std::string& output() {
    char buffer[65536];
    for (ssize_t n = 0; (n = ::read(out_, buffer, sizeof(buffer))) > 0;) {
      if (text_.size() < 1'000'000) text_.append(buffer, static_cast<std::size_t>(n));
    }
    return text_;
  }

 private:
  pid_t pid_{-1};
  int out_{-1};
  std::string text_;
};

class VrpnPrintDevices : public testing::Test {
 protected:
  void SetUp() override {
    const char* program = std::getenv("FIDUCAP_VRPN_CLIENT");
    if (program == nullptr) GTEST_SKIP() << "no VRPN client: set FIDUCAP_VRPN_CLIENT to a vrpn_print_devices";
    program_ = program;
    start();
  }
  void TearDown() override {
    if (server_ == nullptr) return;
    server_->stop();
    io_.restart();
    io_.run();
  }
  void start() {
    auto server = start_vrpn_server(io_, config_, make_scene_frame({"arm", "drone"})->model, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
    config_.port = server_->port();
  }
  [[nodiscard]] std::string by_request(const std::string& body) const {
    return body + "@127.0.0.1:" + std::to_string(config_.port);
  }
  [[nodiscard]] std::string direct(const std::string& body) const {
    return body + "@tcp://127.0.0.1:" + std::to_string(config_.port);
  }
  /// Frames at 100 Hz until the client has printed `wanted`. @return false when it never did.
  bool serve_until(ClientProcess& client, const std::string& wanted) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end) {
      auto frame = make_scene_frame({"arm", "drone"}, ++number_);
      // Known by construction: a third of a turn about the diagonal, x → y → z → x.
      frame->bodies[1].X_WP = {exp_so3(Eigen::Vector3d::Ones() * (2 * M_PI / 3 / std::sqrt(3.0))), {1.25, -2.5, 0.75}};
      server_->publish(frame);
      io_.restart();
      io_.run_for(kFramePeriod);
      if (client.output().find(wanted) != std::string::npos) return true;
    }
    return false;
  }

  std::string program_;
  boost::asio::io_context io_;
  FakeClock clock_;
  VrpnConfig config_{.port = 0};
  std::uint64_t number_{0};
  std::unique_ptr<VrpnStreamer> server_;
};

constexpr const char* kPose = "pos ( 1.25, -2.50,  0.75); quat ( 0.50,  0.50,  0.50,  0.50)";

TEST_F(VrpnPrintDevices, ShowsThePoseByRequest) {
  ClientProcess client(program_, by_request("drone"));
  EXPECT_TRUE(serve_until(client, kPose)) << client.output();
}

TEST_F(VrpnPrintDevices, ShowsThePoseByTcp) {
  ClientProcess client(program_, direct("drone"));
  EXPECT_TRUE(serve_until(client, kPose)) << client.output();
}

TEST_F(VrpnPrintDevices, IsAnsweredAndNeverComplains) {
  ClientProcess client(program_, by_request("drone"));
  EXPECT_FALSE(serve_until(client, "No response")) << client.output();
  EXPECT_THAT(client.output(), HasSubstr(kPose));
  EXPECT_THAT(client.output(), Not(HasSubstr("VRPN Warning")));
}

TEST_F(VrpnPrintDevices, LearnsWhichBodiesThereAre) {
  ClientProcess client(program_, direct("ghost"));
  EXPECT_TRUE(serve_until(client, "no body of this name here; there are: arm, drone")) << client.output();
}

TEST_F(VrpnPrintDevices, ComesBackAfterARestart) {
  ClientProcess client(program_, by_request("drone"));
  ASSERT_TRUE(serve_until(client, kPose)) << client.output();
  server_->stop();
  server_.reset();
  io_.restart();
  io_.run();
  config_.minor_version = 7;  // so that the second greeting shows in the client's output
  start();
  EXPECT_TRUE(serve_until(client, "got 'vrpn: ver. 07.07")) << client.output();
}

}  // namespace
}  // namespace fiducap::vrpn
