#pragma once

#include <memory>
#include <utility>

namespace boost::asio {
class io_context;
}

namespace fiducap::net {

/// An asynchronous wait that its owner renews after each event: for datagrams, connections, frames,
/// ticks. An exception, also one inside Asio, may destroy the handler before it renews the wait. So
/// each wait is registered with its io_context, and `resume_waits` renews those that were lost.
class RepeatedWait {
 public:
  virtual ~RepeatedWait() = default;
  /// Starts the wait unless it is pending or closed. May throw.
  virtual void resume() = 0;
};

/// Registers the wait until it is destroyed.
void register_wait(boost::asio::io_context& io, const std::shared_ptr<RepeatedWait>& wait);

/// After an exception left `io.run()`: resumes every wait that was lost.
/// @return false: some could not be resumed; try again soon
bool resume_waits(boost::asio::io_context& io) noexcept;

/// Whether a wait is pending. Correct also when an exception destroyed the handler or it was never
/// queued: the destructor of the token in the handler resets it. Allocates once.
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
    /// First call of the handler: the next wait may begin.
    void release() {
      if (const auto pending = std::exchange(pending_, nullptr)) *pending = false;
    }

   private:
    std::shared_ptr<bool> pending_;
  };

  /// @return to be moved into the handler
  [[nodiscard]] Token begin() {
    *pending_ = true;
    return Token(pending_);
  }
  explicit operator bool() const { return *pending_; }

 private:
  std::shared_ptr<bool> pending_{std::make_shared<bool>(false)};
};

}  // namespace fiducap::net
