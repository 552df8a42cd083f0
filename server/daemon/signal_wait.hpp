#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <csignal>
#include <functional>

#include "streaming/net/standing_wait.hpp"

namespace fiducap {

/// Waits for SIGINT and SIGTERM on an io_context, whatever an exception takes away.
class SignalWait final : public net::StandingWait {
 public:
  /// @param stop  called at each signal; never throws
  SignalWait(boost::asio::io_context& io, std::function<void()> stop)
      : signals_(io, SIGINT, SIGTERM), stop_(std::move(stop)) {}

  void resume() override {
    if (pending_) return;
    signals_.async_wait(
        [this, token = pending_.begin()](const boost::system::error_code& failure, int) mutable {
          token.release();
          if (failure) return;
          resume();
          stop_();
        });
  }

  /// What comes from now on ends the process at once.
  void release() {
    boost::system::error_code ignored;
    signals_.clear(ignored);
  }

 private:
  boost::asio::signal_set signals_;
  std::function<void()> stop_;
  net::PendingWait pending_;
};

}  // namespace fiducap
