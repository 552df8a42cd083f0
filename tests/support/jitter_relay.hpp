#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <vector>

namespace fiducap {

/// A network with jitter between a UDP client and a server, where the kernel has no netem: each
/// datagram has a uniform delay and may overtake others, as with `netem delay 5ms 2ms`.
class JitterRelay final {
 public:
  JitterRelay(const std::string& host, std::uint16_t server_port, double mean_s, double spread_s)
      : random_(7),  // NOLINT: the same delays in every run
        delay_s_(mean_s - spread_s, mean_s + spread_s) {
    server_.sin_family = AF_INET;
    server_.sin_port = htons(server_port);
    ::inet_pton(AF_INET, host.c_str(), &server_.sin_addr);
    sockaddr_in own = server_;
    own.sin_port = 0;
    outside_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    inside_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    ::bind(outside_, reinterpret_cast<sockaddr*>(&own), sizeof(own));
    ::connect(inside_, reinterpret_cast<sockaddr*>(&server_), sizeof(server_));
    socklen_t size = sizeof(own);
    ::getsockname(outside_, reinterpret_cast<sockaddr*>(&own), &size);
    port_ = ntohs(own.sin_port);
    thread_ = std::thread([this] { run(); });
  }
  ~JitterRelay() {
    stopping_ = true;
    thread_.join();
    ::close(outside_);
    ::close(inside_);
  }
  JitterRelay(const JitterRelay&) = delete;
  JitterRelay& operator=(const JitterRelay&) = delete;

  /// For the client.
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  struct Waiting {
    bool to_server;
    std::vector<std::uint8_t> bytes;
  };

  static std::int64_t now_ns() {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1'000'000'000 + now.tv_nsec;
  }
  void take(bool to_server) {
    std::array<std::uint8_t, 2048> bytes;
    for (;;) {
      sockaddr_in from{};
      socklen_t size = sizeof(from);
      const auto n = ::recvfrom(to_server ? outside_ : inside_, bytes.data(), bytes.size(), 0,
                                reinterpret_cast<sockaddr*>(&from), &size);
      if (n < 0) return;
      if (to_server) client_ = from;
      const auto due = now_ns() + static_cast<std::int64_t>(delay_s_(random_) * 1e9);
      waiting_.emplace(due, Waiting{to_server, {bytes.begin(), bytes.begin() + n}});
    }
  }
  void give() {
    while (!waiting_.empty() && waiting_.begin()->first <= now_ns()) {
      const Waiting& one = waiting_.begin()->second;
      if (one.to_server) {
        ::send(inside_, one.bytes.data(), one.bytes.size(), 0);
      } else {
        ::sendto(outside_, one.bytes.data(), one.bytes.size(), 0,
                 reinterpret_cast<sockaddr*>(&client_), sizeof(client_));
      }
      waiting_.erase(waiting_.begin());
    }
  }
  void run() {
    while (!stopping_) {
      std::int64_t pause = 20'000'000;
      if (!waiting_.empty())
        pause = std::clamp<std::int64_t>(waiting_.begin()->first - now_ns(), 0, pause);
      const timespec timeout{0, pause};
      std::array<pollfd, 2> wanted{{{outside_, POLLIN, 0}, {inside_, POLLIN, 0}}};
      ::ppoll(wanted.data(), wanted.size(), &timeout, nullptr);
      take(true);
      take(false);
      give();
    }
  }

  std::mt19937 random_;
  std::uniform_real_distribution<double> delay_s_;
  sockaddr_in server_{};
  sockaddr_in client_{};
  int outside_{-1};
  int inside_{-1};
  std::uint16_t port_{0};
  std::multimap<std::int64_t, Waiting> waiting_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace fiducap
