#pragma once

#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <functional>
#include <future>
#include <string>
#include <thread>
#include <utility>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>

#include "support/shell.hpp"

namespace fiducap {

/// A thread in a network of its own. Work `on` it, with its threads and sockets, has only that one.
class NetworkNamespace final {
 public:
  NetworkNamespace() {
    std::promise<void> ready;
    thread_ = std::thread([this, &ready] {
      permitted_ = ::unshare(CLONE_NEWNET) == 0;
      id_ = static_cast<int>(::syscall(SYS_gettid));
      ready.set_value();
      io_.run();
    });
    ready.get_future().wait();
  }
  ~NetworkNamespace() {
    work_.reset();
    thread_.join();
  }
  NetworkNamespace(const NetworkNamespace&) = delete;
  NetworkNamespace& operator=(const NetworkNamespace&) = delete;

  [[nodiscard]] bool permitted() const { return permitted_; }
  /// For `ip link … netns ID`.
  [[nodiscard]] int id() const { return id_; }
  void on(const std::function<void()>& work) {
    std::promise<void> done;
    boost::asio::post(io_, [&] {
      work();
      done.set_value();
    });
    done.get_future().wait();
  }
  Shell run(const std::string& command) {
    Shell result;
    on([&] { result = shell(command); });
    return result;
  }

 private:
  boost::asio::io_context io_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_{
      io_.get_executor()};
  bool permitted_{false};
  int id_{0};
  std::thread thread_;
};

/// Two namespaces with a cable between them: 10.213.77.1 and 10.213.77.2.
struct TwoHosts {
  static constexpr const char* kServer = "10.213.77.1";
  static constexpr const char* kClient = "10.213.77.2";

  NetworkNamespace server;
  NetworkNamespace client;
  std::string problem;  ///< Why they are not available; empty: they are.

  TwoHosts() {
    if (!server.permitted() || !client.permitted()) {
      problem = "network namespaces are not permitted (needs root or CAP_SYS_ADMIN)";
      return;
    }
    const auto cable = client.run("ip link add fdc0 type veth peer name fdc0 netns " +
                                  std::to_string(server.id()));
    if (!cable.done) {
      problem = "no veth pair: " + cable.output;
      return;
    }
    for (auto* side : {&server, &client}) {
      const std::string address = side == &server ? kServer : kClient;
      const auto up = side->run("ip addr add " + address +
                                "/24 brd + dev fdc0 && ip link set fdc0 up && ip link set lo up");
      if (!up.done) problem = "no address: " + up.output;
    }
  }
};

}  // namespace fiducap
