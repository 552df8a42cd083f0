// Clients that share no code with our servers, on loopback: those of the vendors, where an
// environment variable names them (nothing of them is part of this project), and a plain one of
// Qualisys in Python.
#include <gmock/gmock.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "streaming/vicon/vicon.hpp"
#include "streaming/vrpn/vrpn.hpp"
#include "support/child_process.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A server with the bodies `arm` and `drone` for the client of another program.
class ThirdPartyClientTest : public testing::Test {
 protected:
  void TearDown() override {
    if (server_ != nullptr) stop();
  }
  template <typename Server>
  void start(Expected<std::unique_ptr<Server>> server) {
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void stop() {
    server_->stop();
    io_.restart();
    io_.run();
    server_.reset();
  }
  [[nodiscard]] std::string port() const { return std::to_string(server_->port()); }
  /// Publishes frames at 100 Hz until the client has printed all of `wanted`, at most `limit_s`.
  bool serve_until(ChildProcess& client, const std::vector<std::string>& wanted) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(limit_s_);
    while (std::chrono::steady_clock::now() < end) {
      auto frame = make_scene_frame(kNames, ++number_);
      // Known by construction: a third of a turn about the diagonal, x → y → z → x.
      frame->bodies[1].X_WP = {exp_so3(Eigen::Vector3d::Ones() * (2 * M_PI / 3 / std::sqrt(3.0))),
                               {1.25, -2.5, 0.75}};
      frame->bodies[0].valid = arm_valid_;
      frame->bodies[1].valid = drone_valid_;
      server_->publish(frame);
      io_.restart();
      io_.run_for(std::chrono::milliseconds(10));
      const std::string text = client.output();
      if (std::all_of(wanted.begin(), wanted.end(),
                      [&](const auto& one) { return text.find(one) != std::string::npos; }))
        return true;
    }
    return false;
  }

  const std::vector<std::string> kNames{"arm", "drone"};
  boost::asio::io_context io_;
  FakeClock clock_;
  int limit_s_{10};
  bool arm_valid_{true};
  bool drone_valid_{true};
  std::uint64_t number_{0};
  std::unique_ptr<Streamer> server_;
};

// --- VRPN: FIDUCAP_VRPN_CLIENT is a `vrpn_print_devices` built from github.com/vrpn/vrpn.

class VrpnPrintDevices : public ThirdPartyClientTest {
 protected:
  void SetUp() override {
    program_ = std::getenv("FIDUCAP_VRPN_CLIENT");
    if (program_ == nullptr)
      GTEST_SKIP() << "no VRPN client: set FIDUCAP_VRPN_CLIENT to a vrpn_print_devices";
    // Three of the client's two-second retries and its warning after 3 s without an answer.
    limit_s_ = 8;
    restart();
  }
  void restart() {
    start(vrpn::serve({io_, make_scene_frame(kNames)->model, clock_}, config_));
    if (server_ != nullptr) config_.port = server_->port();
  }
  /// Line by line: the client's own buffer is lost when it is ended.
  [[nodiscard]] std::vector<std::string> watch(const std::string& body,
                                               const char* scheme = "") const {
    return {"stdbuf", "-oL", program_, body + "@" + scheme + "127.0.0.1:" + port()};
  }

  const char* program_{};
  vrpn::VrpnConfig config_{.port = 0};
};

constexpr const char* kVrpnPose = "pos ( 1.25, -2.50,  0.75); quat ( 0.50,  0.50,  0.50,  0.50)";

TEST_F(VrpnPrintDevices, ShowsThePoseByTcp) {
  ChildProcess client(watch("drone", "tcp://"));
  EXPECT_TRUE(serve_until(client, {kVrpnPose})) << client.output();
}

TEST_F(VrpnPrintDevices, ShowsThePoseByRequestWithoutWarnings) {
  ChildProcess client(watch("drone"));
  EXPECT_FALSE(serve_until(client, {"No response"})) << client.output();
  EXPECT_THAT(client.output(), HasSubstr(kVrpnPose));
  EXPECT_THAT(client.output(), Not(HasSubstr("VRPN Warning")));
}

TEST_F(VrpnPrintDevices, ListsTheBodiesInsteadOfAnUnknownOne) {
  ChildProcess client(watch("ghost", "tcp://"));
  EXPECT_TRUE(serve_until(client, {"no body of this name here; there are: arm, drone"}))
      << client.output();
}

TEST_F(VrpnPrintDevices, ConnectsAgainAfterARestart) {
  ChildProcess client(watch("drone"));
  ASSERT_TRUE(serve_until(client, {kVrpnPose})) << client.output();
  stop();
  config_.minor_version = 7;  // shows the second greeting in the client's output
  restart();
  EXPECT_TRUE(serve_until(client, {"got 'vrpn: ver. 07.07"})) << client.output();
}

// --- Vicon: FIDUCAP_VICON_CLIENT is a `ViconDataStreamSDK_CPPTest` built from the public source of
// the Vicon DataStream SDK.

class ViconSdkClient : public ThirdPartyClientTest {
 protected:
  void SetUp() override {
    program_ = std::getenv("FIDUCAP_VICON_CLIENT");
    if (program_ == nullptr)
      GTEST_SKIP() << "no Vicon client: set FIDUCAP_VICON_CLIENT to a ViconDataStreamSDK_CPPTest";
    vicon::ViconConfig config;
    config.port = 0;
    start(vicon::serve({io_, nullptr, clock_}, config));
  }
  [[nodiscard]] std::vector<std::string> client() const {
    return {program_, "127.0.0.1:" + port()};
  }
  const char* program_{};
};

constexpr const char* kViconPlace = "Global Translation: (1250, -2500, 750) False";

TEST_F(ViconSdkClient, ShowsNamesAndPoseByPull) {
  ChildProcess process(client());
  EXPECT_TRUE(serve_until(process, {"Name: drone", "Root Segment: drone", kViconPlace,
                                    "Global Rotation Quaternion: (0.5, 0.5, 0.5, 0.5) False"}))
      << process.output();
  EXPECT_THAT(process.output(), HasSubstr("Frame rate: 100"));
  EXPECT_THAT(process.output(), HasSubstr("Quality: 0.8"));
}

TEST_F(ViconSdkClient, ShowsThePoseByLightweightSegments) {
  auto arguments = client();
  arguments.push_back("--lightweight");
  ChildProcess process(arguments);
  EXPECT_TRUE(
      serve_until(process, {"Lightweight Segment Data Enabled: True", "Name: drone", kViconPlace}))
      << process.output();
}

TEST_F(ViconSdkClient, ShowsAnInvalidBodyAsOccluded) {
  arm_valid_ = false;
  ChildProcess process(client());
  EXPECT_TRUE(serve_until(process, {"Name: arm", kViconPlace})) << process.output();
  const std::string text = process.output();
  EXPECT_THAT(text, Not(HasSubstr("(1000, -2000, 500)")));
  // In the first frame that it pulls, this client shows every body as occluded.
  const std::size_t drone = text.find(kViconPlace);
  const std::size_t frame = text.rfind("Frame Number:", drone);
  EXPECT_THAT(text.substr(frame, drone - frame), HasSubstr("Global Translation: (0, 0, 0) True"));
}

// --- Qualisys: FIDUCAP_QUALISYS_SDK is the folder of the vendor's Python package (`qtm_rt` or
// `qtm`).

struct QualisysCase {
  std::string client;  ///< `plain` or `sdk`
  std::string order;
  std::string transport;
};

class QualisysClients : public ThirdPartyClientTest,
                        public testing::WithParamInterface<QualisysCase> {
 protected:
  void SetUp() override {
    sdk_ = std::getenv("FIDUCAP_QUALISYS_SDK");
    if (GetParam().client == "sdk" && sdk_ == nullptr)
      GTEST_SKIP()
          << "no Qualisys SDK: set FIDUCAP_QUALISYS_SDK to the folder of its Python package";
    qualisys::QualisysConfig config;
    config.base_port = 0;
    config.discovery_port = 0;
    start(qualisys::serve({io_, make_scene_frame(kNames)->model, clock_}, config));
  }
  const char* sdk_{};
};

TEST_P(QualisysClients, ReadNamesPosesAndLostBodies) {
  const auto& [client, order, transport] = GetParam();
  ChildProcess process({"env", std::string("PYTHONPATH=") + (sdk_ == nullptr ? "" : sdk_),
                        "python3", FIDUCAP_QUALISYS_PRINT, client, port(), order, transport});
  // The rotation turns x into y, y into z, z into x: R by rows.
  EXPECT_TRUE(serve_until(
      process, {"drone at 1250.0 -2500.0 750.0 turned 0.000 0.000 1.000 1.000 0.000 0.000 0.000 "
                "1.000 0.000"}))
      << process.output();
  EXPECT_THAT(process.output(), HasSubstr("names: arm, drone"));
  EXPECT_THAT(process.output(), Not(HasSubstr("lost")));
  drone_valid_ = false;
  EXPECT_TRUE(serve_until(process, {"drone is lost"})) << process.output();
  EXPECT_THAT(process.output(), Not(HasSubstr("arm is lost")));
}

INSTANTIATE_TEST_SUITE_P(
    Each, QualisysClients,
    testing::Values(QualisysCase{"plain", "little", "tcp"}, QualisysCase{"plain", "big", "tcp"},
                    QualisysCase{"plain", "little", "udp"}, QualisysCase{"plain", "big", "udp"},
                    QualisysCase{"sdk", "little", "tcp"}),
    [](const auto& one) {
      return one.param.client + "_" + one.param.order + "_" + one.param.transport;
    });

}  // namespace
}  // namespace fiducap
