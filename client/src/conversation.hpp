#pragma once

#include <cstdint>
#include <string>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// State of the subscription: challenge, lease, renewal, restart, silence. No socket, no clock.
class Conversation {
 public:
  /// @param retry  pause between requests while there is no reply
  /// @param nonce  random; replies to requests of other clients are ignored
  Conversation(Nanoseconds retry, std::uint64_t nonce, std::string client_name,
               Profile profile = {}, bool multicast = false);

  /// A new socket: requests at once.
  void start(Nanoseconds now);
  void on(const Challenge& challenge, Nanoseconds now);
  /// @return true when it replies to our request; `session()` may have changed
  bool on(const Lease& lease, Nanoseconds now);
  void on(const Notice& notice, Nanoseconds now);
  /// A part of a frame or model. @return true when it belongs to our session
  bool heard(std::uint64_t session, Nanoseconds now);
  /// The host reports that the port is closed.
  void refused(Nanoseconds now);
  /// Ends an expired lease or a silent connection. Call before `due`.
  void tick(Nanoseconds now);

  bool due(Nanoseconds now) const { return now >= ask_at_; }
  /// The request to send now. @pre due(now)
  /// @param model_generation  of the complete model; 0: none
  SubscribeRequest question(std::uint64_t model_generation, Nanoseconds now);
  /// Next time at which `tick` or `due` may have an effect.
  Nanoseconds wake_at() const;

  /// No frames arrive by multicast: requests unicast from now on.
  void give_up_multicast(Nanoseconds now);

  bool leased() const { return leased_; }
  bool wants_multicast() const { return multicast_; }
  /// Number that the server gave to our profile.
  std::uint32_t profile() const { return profile_number_; }
  std::uint64_t session() const { return session_; }
  std::uint64_t token() const { return token_; }
  /// Requests since the last reply.
  int unanswered() const { return unanswered_; }
  /// Cause of a missing lease, for a user.
  const std::string& problem() const { return problem_; }

 private:
  void end_lease(const char* problem);
  Nanoseconds pause_after_question(bool model_complete) const;

  Nanoseconds retry_;
  std::uint64_t nonce_;
  std::string client_name_;
  Profile profile_;
  bool multicast_;
  std::uint32_t profile_number_{0};
  bool leased_{false};
  std::uint64_t session_{0};
  std::uint64_t token_{0};
  std::uint64_t model_generation_{0};
  Nanoseconds lease_{0};
  Nanoseconds lease_until_{0};
  Nanoseconds heard_at_{0};
  Nanoseconds asked_at_{0};
  Nanoseconds challenge_used_at_{0};
  Nanoseconds ask_at_{0};
  int unanswered_{0};
  std::string problem_{"no reply yet"};
};

/// The profile that these options request.
/// @throw std::invalid_argument when it does not fit a datagram
[[nodiscard]] Profile profile_of(const ClientOptions& options);

}  // namespace fiducap::sdk
