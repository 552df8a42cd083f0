#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include <Eigen/Core>

namespace fiducap::loop {

/// Input of a controller.
struct Sensed {
  double at_s{};  ///< On the client's clock of the stream.
  Eigen::Vector3d p;
  Eigen::Vector3d v;
};

/// The stream of other systems: late by `delay_s`, with the velocity as difference of two
/// positions.
class LateAndDifferenced final {
 public:
  explicit LateAndDifferenced(double delay_s) : delay_s_(delay_s) {}

  /// @return nullopt until something is old enough
  [[nodiscard]] std::optional<Sensed> pass(const Sensed& now) {
    waiting_.push_back(now);
    bool fresh = false;
    while (!waiting_.empty() && waiting_.front().at_s <= now.at_s - delay_s_) {
      Sensed next = waiting_.front();
      waiting_.pop_front();
      if (last_ && next.at_s > last_->at_s)
        next.v = (next.p - last_->p) / (next.at_s - last_->at_s);
      last_ = next;
      fresh = true;
    }
    return fresh ? last_ : std::nullopt;
  }

 private:
  double delay_s_;
  std::deque<Sensed> waiting_;
  std::optional<Sensed> last_;
};

/// A NatNet 4.1 client as small as an autopilot's: unicast, rigid bodies only. NatNet has no
/// velocity: it is the difference of positions through a low pass of 30 ms, as in such clients.
class NatNetFeed final {
 public:
  NatNetFeed(std::uint16_t port, std::int32_t body_id);
  ~NatNetFeed();
  NatNetFeed(const NatNetFeed&) = delete;
  NatNetFeed& operator=(const NatNetFeed&) = delete;

  /// Waits for the next frame, at most 100 ms. @return nullopt without a frame or a tracked body
  [[nodiscard]] std::optional<Sensed> next();

 private:
  void keep_alive();

  int socket_;
  std::int32_t body_id_;
  std::uint16_t port_;
  std::int64_t sent_ns_{0};
  std::optional<Sensed> last_;
};

}  // namespace fiducap::loop
