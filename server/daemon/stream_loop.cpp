#include "daemon/stream_loop.hpp"

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <optional>
#include <system_error>
#include <thread>

#include <sys/eventfd.h>
#include <unistd.h>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>

#include "base/handover.hpp"
#include "base/log.hpp"
#include "streaming/protocols.hpp"

namespace fiducap {

void SignalWait::resume() {
  if (pending_) return;
  signals_.async_wait(
      [this, token = pending_.begin()](const boost::system::error_code& failure, int) mutable {
        token.release();
        if (failure) return;
        resume();
        stop_();
      });
}

void SignalWait::release() {
  boost::system::error_code ignored;
  signals_.clear(ignored);
}

class FrameMailbox::Impl final : public net::RepeatedWait,
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
    newest_.writing().reset();  // a frame that was not fetched
    const std::uint64_t one = 1;
    // The counter cannot overflow: the reader resets it.
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

namespace {

constexpr std::chrono::milliseconds kRetryDelay{10};  // before a lost wait is tried again
constexpr std::chrono::milliseconds kStopDelay{100};  // for the last messages of the protocols

ProtocolContext context_in(StreamLoop& loop, StreamLoop& other, const ProtocolParts& parts) {
  const auto clients = [&own = loop.hub(), &other = other.hub()] {
    std::vector<ClientStatus> all = *other.shown_clients();
    for (auto& client : own.clients()) all.push_back(std::move(client));
    return all;
  };
  return {loop.io(),        parts.model,    parts.clock,
          &parts.operators, &parts.events,  parts.config.streaming.rate_hz,
          FIDUCAP_VERSION,  parts.join_dds, clients,
          parts.views,      parts.setup};
}

}  // namespace

StreamLoop::StreamLoop(std::string_view name)
    : name_(name), mailbox_(io_, [this](const std::shared_ptr<const SceneFrame>& frame) {
        hub_.publish(frame);
        if (delivered_) delivered_(frame);
      }) {}

void StreamLoop::run() {
  while (!io_.stopped()) {
    log::guarded(
        name_, [] { return "a handler"; }, [this] { io_.run(); });
    // Also after an exception, which cost one handler; the others continue.
    while (!net::resume_waits(io_)) std::this_thread::sleep_for(kRetryDelay);
    if (stopping_) shut_down();
  }
}

void StreamLoop::stop() noexcept {
  stopping_ = true;
  try {
    boost::asio::post(io_, [this] { shut_down(); });
  } catch (...) {  // no memory: ends at once
    io_.stop();
  }
}

void StreamLoop::shut_down() {
  if (std::exchange(is_shutting_down_, true)) return io_.stop();
  mailbox_.close();
  hub_.stop();
  shutdown_timer_.expires_after(kStopDelay);
  shutdown_timer_.async_wait([this](const boost::system::error_code&) { io_.stop(); });
}

Expected<ProtocolPorts> start_protocols(const ProtocolParts& parts) {
  const StreamingConfig& streaming = parts.config.streaming;
  const ProtocolContext in_frames = context_in(parts.frames, parts.pages, parts);
  const ProtocolContext in_pages = context_in(parts.pages, parts.frames, parts);
  ProtocolPorts ports;
  std::optional<Error> failure;
  for_each_protocol(
      [&](std::string_view name, const auto& config, std::uint16_t& port) {
        if (!config.enabled || failure) return;
        constexpr bool can_wait = requires { config.kCanWait; };
        auto server = serve(can_wait ? in_pages : in_frames, config);
        if (server) {
          port = (*server)->port();
          return (can_wait ? parts.pages : parts.frames).hub().add(std::move(*server));
        }
        if (streaming.is_optional(name))
          log::warning(name, "not served: " + server.error().text());
        else
          failure = server.error();
      },
      streaming, ports);
  if (failure) return tl::unexpected(*failure);
  return ports;
}

}  // namespace fiducap
