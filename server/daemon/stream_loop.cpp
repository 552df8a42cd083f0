#include "daemon/stream_loop.hpp"

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <thread>
#include <utility>

#include "daemon/frame_mailbox.hpp"
#include "streaming/net/guard.hpp"
#include "streaming/net/standing_wait.hpp"

namespace fiducap {

namespace {

constexpr std::chrono::milliseconds kBreath{10};    // before a lost wait is tried again
constexpr std::chrono::milliseconds kGoodbye{100};  // for what the protocols still want to say

}  // namespace

class StreamLoop::Impl final {
 public:
  explicit Impl(std::string_view name)
      : name_(name), mailbox_(io_, [this](const std::shared_ptr<const SceneFrame>& frame) {
          hub_.publish(frame);
          if (delivered_) delivered_(frame);
        }) {}

  void run() {
    while (!io_.stopped()) {
      net::guarded(
          name_, [] { return "a handler"; }, [this] { io_.run(); });
      // Here after an exception, too. It cost one handler; the others go on.
      while (!net::resume_waits(io_)) std::this_thread::sleep_for(kBreath);
      if (stopping_) say_goodbye();
    }
  }
  void stop() noexcept {
    stopping_ = true;
    try {
      boost::asio::post(io_, [this] { say_goodbye(); });
    } catch (...) {  // no memory even for that: ends without a goodbye
      io_.stop();
    }
  }
  void say_goodbye() {
    if (std::exchange(said_goodbye_, true)) return io_.stop();
    mailbox_.close();
    hub_.stop();
    goodbye_.expires_after(kGoodbye);
    goodbye_.async_wait([this](const boost::system::error_code&) { io_.stop(); });
  }

  std::string_view name_;
  boost::asio::io_context io_{1};
  // An exception may take the last wait with it; the loop must not end for that.
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_{
      io_.get_executor()};
  boost::asio::steady_timer goodbye_{io_};
  StreamHub hub_;
  FrameMailbox mailbox_;
  Delivered delivered_;
  std::atomic<bool> stopping_{false};
  bool said_goodbye_{false};
};

StreamLoop::StreamLoop(std::string_view name) : impl_(std::make_unique<Impl>(name)) {}
StreamLoop::~StreamLoop() = default;
boost::asio::io_context& StreamLoop::io() { return impl_->io_; }
StreamHub& StreamLoop::hub() { return impl_->hub_; }
void StreamLoop::on_delivered(Delivered delivered) { impl_->delivered_ = std::move(delivered); }
void StreamLoop::put(std::shared_ptr<const SceneFrame> frame) {
  impl_->mailbox_.put(std::move(frame));
}
void StreamLoop::run() { impl_->run(); }
void StreamLoop::stop() noexcept { impl_->stop(); }

}  // namespace fiducap
