// A real VRPN client against our server, on loopback. Set FIDUCAP_VRPN_CLIENT to a
// `vrpn_print_devices` built from github.com/vrpn/vrpn; nothing of it is part of this project.
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdlib>
#include <string>

#include "base/pose.hpp"
#include "streaming/vrpn/vrpn.hpp"
#include "support/client_process.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vrpn {
namespace {

using testing::HasSubstr;
using testing::Not;

// Long enough for three of the client's two-second retries and its warning after 3 s without an
// answer.
constexpr auto kPatience = std::chrono::seconds(8);
constexpr auto kFramePeriod = std::chrono::milliseconds(10);

class VrpnPrintDevices : public testing::Test {
 protected:
  void SetUp() override {
    const char* program = std::getenv("FIDUCAP_VRPN_CLIENT");
    if (program == nullptr)
      GTEST_SKIP() << "no VRPN client: set FIDUCAP_VRPN_CLIENT to a vrpn_print_devices";
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
    auto server =
        start_vrpn_server(io_, config_, make_scene_frame({"arm", "drone"})->model, clock_);
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
  /// Line by line: the client's own buffer is lost when it is ended.
  [[nodiscard]] std::vector<std::string> watch(const std::string& device) const {
    return {"stdbuf", "-oL", program_, device};
  }
  /// Frames at 100 Hz until the client has printed `wanted`. @return false when it never did.
  bool serve_until(ClientProcess& client, const std::string& wanted) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end) {
      auto frame = make_scene_frame({"arm", "drone"}, ++number_);
      // Known by construction: a third of a turn about the diagonal, x → y → z → x.
      frame->bodies[1].X_WP = {exp_so3(Eigen::Vector3d::Ones() * (2 * M_PI / 3 / std::sqrt(3.0))),
                               {1.25, -2.5, 0.75}};
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
  std::unique_ptr<Streamer> server_;
};

constexpr const char* kPose = "pos ( 1.25, -2.50,  0.75); quat ( 0.50,  0.50,  0.50,  0.50)";

TEST_F(VrpnPrintDevices, ShowsThePoseByRequest) {
  ClientProcess client(watch(by_request("drone")));
  EXPECT_TRUE(serve_until(client, kPose)) << client.output();
}

TEST_F(VrpnPrintDevices, ShowsThePoseByTcp) {
  ClientProcess client(watch(direct("drone")));
  EXPECT_TRUE(serve_until(client, kPose)) << client.output();
}

TEST_F(VrpnPrintDevices, IsAnsweredAndNeverComplains) {
  ClientProcess client(watch(by_request("drone")));
  EXPECT_FALSE(serve_until(client, "No response")) << client.output();
  EXPECT_THAT(client.output(), HasSubstr(kPose));
  EXPECT_THAT(client.output(), Not(HasSubstr("VRPN Warning")));
}

TEST_F(VrpnPrintDevices, LearnsWhichBodiesThereAre) {
  ClientProcess client(watch(direct("ghost")));
  EXPECT_TRUE(serve_until(client, "no body of this name here; there are: arm, drone"))
      << client.output();
}

TEST_F(VrpnPrintDevices, ComesBackAfterARestart) {
  ClientProcess client(watch(by_request("drone")));
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
