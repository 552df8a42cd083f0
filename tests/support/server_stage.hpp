#pragma once

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "support/fake_clock.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {

/// A server and its clients on real loopback sockets, all in this thread. Derived classes own the
/// server.
/// @tparam Client  has pump()
template <class Client>
class ServerStage : public testing::Test {
 protected:
  std::shared_ptr<SceneFrame> frame() { return make_scene_frame(names_, ++number_); }

  void step() {
    io_.restart();
    io_.run_for(std::chrono::milliseconds(1));
    io_.restart();
    io_.poll();  // on a busy machine the millisecond may be over before the first handler
    for (auto* client : clients_) client->pump();
  }
  void steps(int n) {
    for (int i = 0; i < n; ++i) step();
  }
  [[nodiscard]] bool until(const std::function<bool()>& holds) {
    constexpr auto kTimeout = std::chrono::seconds(120);  // a test that hangs has failed
    const auto end = std::chrono::steady_clock::now() + kTimeout;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > end) return false;
      step();
    }
    return true;
  }
  /// Time passes for the server only; its housekeeping runs every 100 ms of real time.
  void pass(Duration d) {
    clock_.advance(d);
    steps(150);
  }

  boost::asio::io_context io_;
  FakeClock clock_{instant_from_ns(1'000'000'000)};
  std::vector<std::string> names_{"arm", "drone"};
  std::uint64_t number_{0};
  std::vector<Client*> clients_;
};

}  // namespace fiducap
