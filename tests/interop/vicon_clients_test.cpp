// The vendor's own client against our server, on loopback. Set FIDUCAP_VICON_CLIENT to a
// `ViconDataStreamSDK_CPPTest` built from the public source of the Vicon DataStream SDK; nothing of
// it is part of this project.
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "streaming/vicon/vicon.hpp"
#include "support/client_process.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vicon {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr auto kPatience = std::chrono::seconds(10);
constexpr auto kFramePeriod = std::chrono::milliseconds(10);

class ViconSdkClient : public testing::Test {
 protected:
  void SetUp() override {
    const char* program = std::getenv("FIDUCAP_VICON_CLIENT");
    if (program == nullptr)
      GTEST_SKIP() << "no Vicon client: set FIDUCAP_VICON_CLIENT to a ViconDataStreamSDK_CPPTest";
    program_ = program;
    config_.port = 0;
    auto server = start_vicon_server(io_, config_, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void TearDown() override {
    if (server_ == nullptr) return;
    server_->stop();
    io_.restart();
    io_.run();
  }
  [[nodiscard]] std::vector<std::string> client(
      const std::vector<std::string>& options = {}) const {
    std::vector<std::string> all{program_, "127.0.0.1:" + std::to_string(server_->port())};
    all.insert(all.end(), options.begin(), options.end());
    return all;
  }
  /// Frames at 100 Hz until the client has printed all of `wanted`. @return false when it never did
  bool serve_until(ClientProcess& client, const std::vector<std::string>& wanted) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end) {
      auto frame = make_scene_frame({"arm", "drone"}, ++number_);
      // Known by construction: a third of a turn about the diagonal, x → y → z → x.
      frame->bodies[1].X_WP = {exp_so3(Eigen::Vector3d::Ones() * (2 * M_PI / 3 / std::sqrt(3.0))),
                               {1.25, -2.5, 0.75}};
      frame->bodies[0].valid = arm_valid_;
      server_->publish(frame);
      io_.restart();
      io_.run_for(kFramePeriod);
      const std::string& text = client.output();
      bool all = true;
      for (const auto& one : wanted) all = all && text.find(one) != std::string::npos;
      if (all) return true;
    }
    return false;
  }

  std::string program_;
  boost::asio::io_context io_;
  FakeClock clock_;
  ViconConfig config_;
  bool arm_valid_{true};
  std::uint64_t number_{0};
  std::unique_ptr<Streamer> server_;
};

const std::vector<std::string> kDrone{"Name: drone", "Root Segment: drone",
                                      "Global Translation: (1250, -2500, 750) False",
                                      "Global Rotation Quaternion: (0.5, 0.5, 0.5, 0.5) False"};

TEST_F(ViconSdkClient, ShowsNamesAndPoseByPull) {
  ClientProcess process(client());
  EXPECT_TRUE(serve_until(process, kDrone)) << process.output();
  EXPECT_THAT(process.output(), HasSubstr("Frame rate: 100"));
  EXPECT_THAT(process.output(), HasSubstr("Quality: 0.8"));
}

TEST_F(ViconSdkClient, ShowsThePoseByLightweightSegments) {
  ClientProcess process(client({"--lightweight"}));
  EXPECT_TRUE(serve_until(process, {"Lightweight Segment Data Enabled: True", kDrone[0],
                                    "Global Translation: (1250, -2500, 750) False"}))
      << process.output();
}

TEST_F(ViconSdkClient, ShowsAnInvalidBodyAsOccluded) {
  arm_valid_ = false;
  ClientProcess process(client());
  EXPECT_TRUE(serve_until(process, {"Name: arm", "Global Translation: (1250, -2500, 750) False"}))
      << process.output();
  EXPECT_THAT(process.output(), Not(HasSubstr("(1000, -2000, 500)")));
  EXPECT_THAT(process.output(), HasSubstr("Global Translation: (0, 0, 0) True"));
}

}  // namespace
}  // namespace fiducap::vicon
