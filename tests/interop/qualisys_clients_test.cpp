// Clients of the Qualisys protocol that share no code with our server, on loopback: always a plain
// one in Python, and the vendor's Python SDK when FIDUCAP_QUALISYS_SDK names the folder that holds
// its package (`qtm_rt` or `qtm`). Nothing of the SDK is part of this project.
#include <gmock/gmock.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/pose.hpp"
#include "streaming/qualisys/qualisys.hpp"
#include "support/client_process.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::qualisys {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr auto kPatience = std::chrono::seconds(10);
constexpr auto kFramePeriod = std::chrono::milliseconds(10);

struct How {
  std::string client;  ///< `plain` or `sdk`
  std::string order;
  std::string transport;
};

class QualisysClients : public testing::TestWithParam<How> {
 protected:
  void SetUp() override {
    sdk_ = std::getenv("FIDUCAP_QUALISYS_SDK");
    if (GetParam().client == "sdk" && sdk_ == nullptr)
      GTEST_SKIP()
          << "no Qualisys SDK: set FIDUCAP_QUALISYS_SDK to the folder of its Python package";
    QualisysConfig config;
    config.base_port = 0;
    config.discovery_port = 0;
    auto server =
        start_qualisys_server(io_, config, nullptr, make_scene_frame(kNames)->model, clock_);
    ASSERT_TRUE(server) << server.error().text();
    server_ = std::move(*server);
  }
  void TearDown() override {
    if (server_ == nullptr) return;
    server_->stop();
    io_.restart();
    io_.run();
  }
  [[nodiscard]] std::vector<std::string> client() const {
    const How& how = GetParam();
    return {"env",      std::string("PYTHONPATH=") + (sdk_ == nullptr ? "" : sdk_),
            "python3",  FIDUCAP_QUALISYS_PRINT,
            how.client, std::to_string(server_->base_port()),
            how.order,  how.transport};
  }
  /// Frames at 100 Hz until the client has printed `wanted`. @return false when it never did
  bool serve_until(ClientProcess& client, const std::string& wanted) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end) {
      auto frame = make_scene_frame(kNames, ++number_);
      // Known by construction: a third of a turn about the diagonal, x → y → z → x.
      frame->bodies[1].X_WP = {exp_so3(Eigen::Vector3d::Ones() * (2 * M_PI / 3 / std::sqrt(3.0))),
                               {1.25, -2.5, 0.75}};
      frame->bodies[1].valid = drone_valid_;
      server_->publish(frame);
      io_.restart();
      io_.run_for(kFramePeriod);
      if (client.output().find(wanted) != std::string::npos) return true;
    }
    return false;
  }

  const std::vector<std::string> kNames{"arm", "drone"};
  const char* sdk_{};
  boost::asio::io_context io_;
  FakeClock clock_;
  bool drone_valid_{true};
  std::uint64_t number_{0};
  std::unique_ptr<QualisysStreamer> server_;
};

TEST_P(QualisysClients, ReadNamesPoseAndThatABodyIsLost) {
  ClientProcess process(client());
  // The rotation turns x into y, y into z, z into x: R by rows.
  EXPECT_TRUE(serve_until(
      process,
      "drone at 1250.0 -2500.0 750.0 turned 0.000 0.000 1.000 1.000 0.000 0.000 0.000 1.000 0.000"))
      << process.output();
  EXPECT_THAT(process.output(), HasSubstr("names: arm, drone"));
  EXPECT_THAT(process.output(), Not(HasSubstr("lost")));
  drone_valid_ = false;
  EXPECT_TRUE(serve_until(process, "drone is lost")) << process.output();
  EXPECT_THAT(process.output(), Not(HasSubstr("arm is lost")));
}

INSTANTIATE_TEST_SUITE_P(Each, QualisysClients,
                         testing::Values(How{"plain", "little", "tcp"}, How{"plain", "big", "tcp"},
                                         How{"plain", "little", "udp"}, How{"plain", "big", "udp"},
                                         How{"sdk", "little", "tcp"}),
                         [](const auto& how) {
                           return how.param.client + "_" + how.param.order + "_" +
                                  how.param.transport;
                         });

}  // namespace
}  // namespace fiducap::qualisys
