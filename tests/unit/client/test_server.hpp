#pragma once

#include <gtest/gtest.h>
#include <fiducap/client.hpp>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <functional>
#include <future>
#include <thread>

#include "streaming/native/native.hpp"
#include "support/fake_clock.hpp"
#include "support/real_clock.hpp"
#include "support/results.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {

// A longer delay is a failure, also on a loaded machine.
inline constexpr std::chrono::seconds kTimeout{20};

inline std::int64_t monotonic_ns() { return to_ns(RealClock{}.now()); }

/// A server with its I/O thread, as in fiducapd.
class TestServer {
 public:
  explicit TestServer(const SceneFrame& scene, std::uint16_t port = 0,
                      native::NativeConfig config = {}, OperatorApi* operator_api = nullptr,
                      const Clock* clock = nullptr, const EventBoard* events = nullptr) {
    config.port = port;
    server_ = value_of(native::serve(
        {io_, scene.model, clock != nullptr ? *clock : clock_, operator_api, events}, config));
    port_ = server_->port();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~TestServer() {
    on_io([this] { server_.reset(); });  // notifies its clients
    work_.reset();
    thread_.join();
  }
  TestServer(const TestServer&) = delete;
  TestServer& operator=(const TestServer&) = delete;

  std::uint16_t port() const { return port_; }
  FakeClock& clock() { return clock_; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    on_io([&] { server_->publish(frame); });
  }
  std::vector<ClientStatus> clients() {
    std::vector<ClientStatus> all;
    on_io([&] { server_->append_clients(all); });
    return all;
  }

 private:
  void on_io(const std::function<void()>& work) {
    std::promise<void> done;
    boost::asio::post(io_, [&] {
      work();
      done.set_value();
    });
    done.get_future().wait();
  }

  boost::asio::io_context io_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_{
      io_.get_executor()};
  FakeClock clock_{instant_from_ns(1'000'000'000'000)};
  std::unique_ptr<Streamer> server_;
  std::uint16_t port_{};
  std::thread thread_;
};

/// Repeats `step` until the condition holds. @return false after kTimeout
inline bool wait_until(
    const std::function<bool()>& condition, const std::function<void()>& step = [] {}) {
  const auto end = std::chrono::steady_clock::now() + kTimeout;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    step();
    std::this_thread::sleep_for(std::chrono::milliseconds(2));  // the rate of a 500 Hz server
  }
  return true;
}

/// Publishes until the condition holds. @return false after kTimeout
inline bool publish_until(TestServer& server, SceneFrame& scene,
                          const std::function<bool()>& condition) {
  return wait_until(condition, [&] {
    ++scene.number;
    scene.at = instant_from_ns(monotonic_ns());
    server.publish(std::make_shared<SceneFrame>(scene));
  });
}

inline ClientOptions options_for(std::uint16_t port) {
  ClientOptions options;
  options.port = port;
  options.reconnect_s = 0.1;
  options.name = "test";
  return options;
}

/// A server that publishes `scene_` until a client has what the test waits for.
class ClientServerTest : public testing::Test {
 protected:
  void start(const native::NativeConfig& config = {}, std::uint16_t port = 0) {
    server_ = std::make_unique<TestServer>(*scene_, port, config);
  }
  [[nodiscard]] ClientOptions options() const { return options_for(server_->port()); }
  /// Starts a server if there is none, and a client, which receives a frame.
  void connect(const std::function<void(ClientOptions&)>& change = [](ClientOptions&) {}) {
    if (!server_) start();
    ClientOptions changed = options();
    change(changed);
    client_ = std::make_unique<Client>(changed);
    ASSERT_TRUE(receives(*client_)) << client_->statistics().problem;
  }
  bool publish_until(const std::function<bool()>& condition) {
    return fiducap::publish_until(*server_, *scene_, condition);
  }
  /// The next frame.
  bool receives(const Client& client) {
    const auto before = client.statistics().frames;
    return publish_until([&] { return client.statistics().frames > before; }) &&
           client.latest(frame_);
  }
  [[nodiscard]] ClientStatistics statistics() const { return client_->statistics(); }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone", "arm"}, 1);
  std::unique_ptr<TestServer> server_;
  std::unique_ptr<Client> client_;
  Frame frame_;
};

}  // namespace fiducap
