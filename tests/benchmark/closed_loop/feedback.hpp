#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include <Eigen/Core>

namespace fiducap::loop {

/// What a controller is told about its robot.
struct Sensed {
  double at_s{};  ///< On the client's clock of the stream.
  Eigen::Vector3d p;
  Eigen::Vector3d v;
};

/// A stream as other systems give it: late by `delay_s`, and the velocity is the difference of two
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

}  // namespace fiducap::loop
