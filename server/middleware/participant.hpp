#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "middleware/network.hpp"

/// Membership in a DDS domain. The calls of Cyclone DDS are in this folder; other code includes its
/// header only to fill its structs.
namespace fiducap::dds {

/// One entity of the middleware; its destructor deletes it and its children.
class Entity final {
 public:
  Entity() = default;
  explicit Entity(std::int32_t handle) : handle_(handle) {}
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;
  ~Entity();

  [[nodiscard]] std::int32_t handle() const { return handle_; }
  [[nodiscard]] explicit operator bool() const { return handle_ > 0; }

 private:
  std::int32_t handle_{0};
};

/// Participants of the domain, including this one and forged ones.
struct ParticipantCount {
  static constexpr int kMostPresent = 256;
  static constexpr int kMostSeen = 4096;

  int present{};  ///< Now.
  int seen{};     ///< Since the domain was joined.

  [[nodiscard]] bool is_plausible() const { return present <= kMostPresent && seen <= kMostSeen; }
};

/// Counts the participants that a participant knows. Thread-safe.
class ParticipantMonitor final {
 public:
  using Alarm = std::function<void(const ParticipantCount&)>;

  /// @param alarm  called once when there are too many, on a thread of the middleware
  explicit ParticipantMonitor(Alarm alarm) : alarm_(std::move(alarm)) {}
  /// @param participant  is deleted before the monitor
  [[nodiscard]] Expected<void> watch(std::int32_t participant);
  [[nodiscard]] ParticipantCount count() const { return {present_, seen_}; }
  [[nodiscard]] bool is_flooded() const { return flooded_; }

 private:
  void take_samples(std::int32_t reader);
  void add(bool is_new, bool is_alive);

  Alarm alarm_;
  std::atomic<int> present_{0};
  std::atomic<int> seen_{0};
  std::atomic<bool> flooded_{false};
};

/// The process's membership in one domain. Thread-safe.
class Participant final {
 public:
  /// @param alarm  called once when the domain is flooded, on a thread of the middleware
  /// @return Error when the interface does not exist, or when this process is in the domain already
  [[nodiscard]] static Expected<std::shared_ptr<Participant>> open(
      const NetworkConfig& config, ParticipantMonitor::Alarm alarm = {});

  [[nodiscard]] std::int32_t handle() const { return participant_.handle(); }
  [[nodiscard]] int domain() const { return domain_; }
  [[nodiscard]] ParticipantCount count() const { return monitor_->count(); }
  /// There are more participants than plausible: release this one, so that they are forgotten.
  [[nodiscard]] bool is_flooded() const { return monitor_->is_flooded(); }

 private:
  Participant(std::unique_ptr<ParticipantMonitor> monitor, Entity domain_entity, Entity participant,
              int domain)
      : monitor_(std::move(monitor)),
        domain_entity_(std::move(domain_entity)),
        participant_(std::move(participant)),
        domain_(domain) {}

  std::unique_ptr<ParticipantMonitor> monitor_;  // goes last: is called until the others have gone
  Entity domain_entity_;
  Entity participant_;
  int domain_;
};

/// The process's only participant: made when first needed, deleted when its last owner releases it.
/// Thread-safe.
///
/// Cyclone DDS keeps every participant that a datagram announces for the lease that it claims, and
/// sends to its address all the time. Only leaving the domain forgets them: owners of a flooded
/// participant release it and join again later.
class Membership final {
 public:
  Membership(const NetworkConfig& config, EventBoard& events) : config_(config), events_(events) {}

  /// @return the participant that others hold, or a new one; Error while a flooded one is still
  ///         held, or the last one is still leaving
  [[nodiscard]] Expected<std::shared_ptr<Participant>> join();

 private:
  NetworkConfig config_;
  EventBoard& events_;
  std::mutex mutex_;
  std::weak_ptr<Participant> participant_;
  /// The last participant is deleted; `participant_` expires when its deletion begins.
  std::shared_ptr<std::atomic<bool>> has_left_{std::make_shared<std::atomic<bool>>(true)};
};

/// Error of a negative return code of the middleware.
[[nodiscard]] tl::unexpected<Error> failure_of(std::int32_t code, const std::string& what,
                                               const std::string& context);

}  // namespace fiducap::dds
