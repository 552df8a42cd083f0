#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "base/event_board.hpp"
#include "base/expected.hpp"
#include "base/time.hpp"
#include "middleware/network.hpp"

/// Membership in a DDS domain. Cyclone DDS is called in this folder only.
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

/// The process's membership in one domain; counts the participants that it knows. Thread-safe.
class Participant final {
 public:
  using Alarm = std::function<void(const ParticipantCount&)>;
  /// @param alarm  called once when the domain is flooded, on a thread of the middleware
  /// @return Error when the interface does not exist, or when this process is in the domain already
  [[nodiscard]] static Expected<std::shared_ptr<Participant>> open(const NetworkConfig& config,
                                                                   Alarm alarm = {});

  [[nodiscard]] std::int32_t handle() const { return participant_.handle(); }
  [[nodiscard]] int domain() const { return domain_; }
  [[nodiscard]] ParticipantCount count() const { return {present_, seen_}; }
  /// Release this one and join again: there are more participants than plausible, which are then
  /// forgotten, or `look_at_cards` has found other cards.
  [[nodiscard]] bool is_to_be_left() const { return flooded_ || cards_changed_; }
  /// On loopback: whether none of the cards is left by which local programs find this participant,
  /// and there is another one. Asks the system: once a second or less.
  void look_at_cards();

 private:
  Participant(Entity domain_entity, Entity participant, int domain, AllowedSenders senders,
              Alarm alarm)
      : alarm_(std::move(alarm)),
        senders_(std::move(senders)),
        domain_entity_(std::move(domain_entity)),
        participant_(std::move(participant)),
        domain_(domain) {}
  [[nodiscard]] Expected<void> watch();
  void take_samples(std::int32_t reader);

  // Used by threads of the middleware until the entities have gone.
  Alarm alarm_;
  std::atomic<int> present_{0};
  std::atomic<int> seen_{0};
  std::atomic<bool> flooded_{false};
  std::atomic<bool> cards_changed_{false};
  AllowedSenders senders_;
  Entity domain_entity_;
  Entity participant_;
  int domain_;
};

/// The process's only participant: made when needed, deleted with its last owner. Thread-safe.
///
/// Cyclone DDS keeps every announced participant for the lease that it claims, and sends to its
/// address. Only leaving the domain forgets them: owners of a flooded one release it and rejoin.
class Membership final {
 public:
  Membership(const NetworkConfig& config, EventBoard& events) : config_(config), events_(events) {}

  /// @return the present participant or a new one; Error while a flooded or former one is leaving
  [[nodiscard]] Expected<std::shared_ptr<Participant>> join();
  /// Participant::look_at_cards of the present participant, if there is one.
  void look_at_cards();

 private:
  NetworkConfig config_;
  EventBoard& events_;
  std::mutex mutex_;
  std::weak_ptr<Participant> participant_;
  /// The last participant is deleted; `participant_` expires when its deletion begins.
  std::shared_ptr<std::atomic<bool>> has_left_{std::make_shared<std::atomic<bool>>(true)};
};

/// Joins the domain for at most `wait` as a program of this machine does by its defaults: by the
/// card that Cyclone DDS chooses. Nothing leaves the machine, and nothing from outside is received.
/// @param process  name of the program, as its participant announces it
/// @return whether a topic of such a program of this machine was announced
[[nodiscard]] Expected<bool> is_found_by_default(int domain, std::string_view process,
                                                 Duration wait);

/// Error of a negative return code of the middleware.
[[nodiscard]] tl::unexpected<Error> failure_of(std::int32_t code, const std::string& what,
                                               const std::string& context);

}  // namespace fiducap::dds
