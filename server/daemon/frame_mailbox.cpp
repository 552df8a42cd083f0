#include "daemon/frame_mailbox.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <cerrno>
#include <cstdint>
#include <system_error>
#include <utility>

#include "base/newest_value.hpp"
#include "streaming/net/standing_wait.hpp"

namespace fiducap {

class FrameMailbox::Impl final : public net::StandingWait,
                                 public std::enable_shared_from_this<Impl> {
 public:
  Impl(boost::asio::io_context& io, Receiver receiver)
      : wakeup_(io, open_wakeup()),
        wakeup_fd_(wakeup_.native_handle()),
        receiver_(std::move(receiver)) {}

  void resume() override {
    if (waiting_ || !receiver_) return;
    wakeup_.async_wait(boost::asio::posix::stream_descriptor::wait_read,
                       [self = shared_from_this(), token = waiting_.begin()](
                           const boost::system::error_code& failure) mutable {
                         token.release();
                         if (failure) return;
                         self->deliver();
                         self->resume();
                       });
  }

  void put(std::shared_ptr<const SceneFrame> frame) {
    newest_.writing() = std::move(frame);
    newest_.offer();
    newest_.writing().reset();  // the frame that nobody fetched, if there was one
    const std::uint64_t one = 1;
    // The counter cannot fill up: the reader sets it back to zero, and 2^64 frames take a while.
    [[maybe_unused]] const auto written = ::write(wakeup_fd_, &one, sizeof one);
  }

  void close() {
    receiver_ = nullptr;
    boost::system::error_code ignored;
    wakeup_.cancel(ignored);
  }

 private:
  static int open_wakeup() {
    const int fd = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (fd < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
    return fd;
  }

  void deliver() {
    std::uint64_t count{};
    [[maybe_unused]] const auto read = ::read(wakeup_fd_, &count, sizeof count);
    if (!newest_.fetch()) return;
    const std::shared_ptr<const SceneFrame> frame = std::move(newest_.reading());
    if (frame && receiver_) receiver_(frame);
  }

  boost::asio::posix::stream_descriptor wakeup_;
  int wakeup_fd_;
  Receiver receiver_;
  NewestValue<std::shared_ptr<const SceneFrame>> newest_;
  net::PendingWait waiting_;
};

FrameMailbox::FrameMailbox(boost::asio::io_context& io, Receiver receiver)
    : impl_(std::make_shared<Impl>(io, std::move(receiver))) {
  net::register_wait(io, impl_);
  impl_->resume();
}
FrameMailbox::~FrameMailbox() { close(); }
void FrameMailbox::put(std::shared_ptr<const SceneFrame> frame) { impl_->put(std::move(frame)); }
void FrameMailbox::close() { impl_->close(); }

}  // namespace fiducap
