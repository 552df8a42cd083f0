#pragma once

#include <memory>
#include <utility>

namespace boost::asio {
class io_context;
}

namespace fiducap::net {

/// An asynchronous wait that its owner takes up again after each event, for as long as it lives:
/// for datagrams, connections, frames, ticks. An exception, even one inside of Asio, may take the
/// handler away before it could do so; then nobody would ever wait again. So each is registered
/// with its io_context, and `resume_waits` takes up those that were lost.
class StandingWait {
 public:
  virtual ~StandingWait() = default;
  /// Waits, unless it does so already or is closed. May throw.
  virtual void resume() = 0;
};

/// Keeps an eye on it until it dies.
void register_wait(boost::asio::io_context& io, const std::shared_ptr<StandingWait>& wait);

/// Where an exception left `io.run()`: takes up every wait that was lost. Never throws.
/// @return false: some could not be; try again soon
bool resume_waits(boost::asio::io_context& io) noexcept;

/// Whether a wait is under way. True to the facts also when an exception took its handler away, or
/// when it was never queued: the token in the handler says so when it dies. Allocates once.
class PendingWait final {
 public:
  class Token final {
   public:
    explicit Token(std::shared_ptr<bool> pending) : pending_(std::move(pending)) {}
    Token(Token&&) noexcept = default;
    Token& operator=(Token&&) = delete;
    Token(const Token&) = delete;
    Token& operator=(const Token&) = delete;
    ~Token() { release(); }
    /// First thing in the handler: this wait is over, the next one may begin.
    void release() {
      if (const auto pending = std::exchange(pending_, nullptr)) *pending = false;
    }

   private:
    std::shared_ptr<bool> pending_;
  };

  /// Goes into the handler.
  [[nodiscard]] Token begin() {
    *pending_ = true;
    return Token(pending_);
  }
  explicit operator bool() const { return *pending_; }

 private:
  std::shared_ptr<bool> pending_{std::make_shared<bool>(false)};
};

}  // namespace fiducap::net
