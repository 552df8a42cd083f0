#pragma once

#include <atomic>
#include <memory>
#include <mutex>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "middleware/participant.hpp"

namespace fiducap::dds {

/// The process's one participant, made when first needed and left when nobody holds it any more.
///
/// Cyclone DDS keeps all that a datagram claims to be, for as long as it claims to live, and greets
/// its address for ever. Only leaving the domain forgets them: who finds the participant crowded
/// lets go of it, and joins again later. From any thread.
class Membership final {
 public:
  Membership(const NetworkConfig& config, EventBoard& events) : config_(config), events_(events) {}

  /// @return the participant that others hold already, or a new one; Error while a crowded one is
  /// still held, or the last one still leaves
  [[nodiscard]] Expected<std::shared_ptr<Participant>> join();

 private:
  NetworkConfig config_;
  EventBoard& events_;
  std::mutex mutex_;
  std::weak_ptr<Participant> participant_;
  /// The last one has left entirely; its weak_ptr is empty as soon as it begins to.
  std::shared_ptr<std::atomic<bool>> has_left_{std::make_shared<std::atomic<bool>>(true)};
};

}  // namespace fiducap::dds
