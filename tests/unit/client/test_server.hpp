#pragma once

#include <gtest/gtest.h>
#include <fiducap/client.hpp>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <functional>
#include <future>
#include <thread>

#include "streaming/native/native.hpp"
#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {

// What takes longer than this on a loaded machine is broken.
inline constexpr std::chrono::seconds kPatience{20};

inline std::int64_t monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1'000'000'000 + now.tv_nsec;
}

/// A server with its I/O thread, as in fiducapd.
class TestServer {
 public:
  explicit TestServer(const SceneFrame& scene, std::uint16_t port = 0,
                      native::NativeConfig config = {}, OperatorApi* operator_api = nullptr,
                      const Clock* clock = nullptr, const EventBoard* events = nullptr) {
    config.port = port;
    auto started = native::start_native_server(
        io_, config, scene.model, clock != nullptr ? *clock : clock_, operator_api, events);
    EXPECT_TRUE(started) << started.error().text();
    server_ = std::move(*started);
    port_ = server_->port();
    thread_ = std::thread([this] { io_.run(); });
  }
  ~TestServer() {
    on_io([this] { server_.reset(); });  // tells its clients
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

/// Publishes until the condition holds. @return false when patience ends.
inline bool publish_until(TestServer& server, SceneFrame& scene,
                          const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    ++scene.number;
    scene.at = instant_from_ns(monotonic_ns());
    server.publish(std::make_shared<SceneFrame>(scene));
    std::this_thread::sleep_for(std::chrono::milliseconds(2));  // the pace of a 500 Hz server
  }
  return true;
}

inline bool wait_until(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

inline ClientOptions options_for(std::uint16_t port) {
  ClientOptions options;
  options.port = port;
  options.reconnect_s = 0.1;
  options.name = "test";
  return options;
}

inline std::vector<std::string> names(int count) {
  std::vector<std::string> all;
  for (int i = 0; i < count; ++i) all.push_back("body" + std::to_string(i));
  return all;
}

/// Servers publish this scene until a client has what the test waits for.
class ClientServerTest : public testing::Test {
 protected:
  bool receives_frame(const Client& client, TestServer& server, Frame& frame) {
    const auto before = client.statistics().frames;
    return publish_until(server, *scene_, [&] { return client.statistics().frames > before; }) &&
           client.latest(frame);
  }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone", "arm"}, 1);
};

}  // namespace fiducap
