#pragma once

#include <cstdint>
#include <string>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// When to ask the server for what: challenge, lease, renewal, restart, silence. No socket; time is
/// passed in.
class Conversation {
 public:
  /// @param retry  pause between questions while nobody answers
  /// @param nonce  random; answers to somebody else's question are ignored
  Conversation(Nanoseconds retry, std::uint64_t nonce, std::string client_name,
               Profile profile = {}, bool multicast = false);

  /// A new socket: ask at once.
  void start(Nanoseconds now);
  void on(const Challenge& challenge, Nanoseconds now);
  /// @return true when it was the answer to our question; `session()` may be another one now.
  bool on(const Lease& lease, Nanoseconds now);
  void on(const Notice& notice, Nanoseconds now);
  /// A part of a frame or model. @return true when it belongs to our session.
  bool heard(std::uint64_t session, Nanoseconds now);
  /// The host says that nobody listens at the port.
  void refused(Nanoseconds now);
  /// Ends a lease that ran out or a connection that fell silent. Call before `due`.
  void tick(Nanoseconds now);

  bool due(Nanoseconds now) const { return now >= ask_at_; }
  /// The question to send now. @pre due(now)
  /// @param model_generation  complete at this side; 0: none
  SubscribeRequest question(std::uint64_t model_generation, Nanoseconds now);
  /// When `tick` or `due` may have something to do.
  Nanoseconds wake_at() const;

  /// The group stays silent here: from the next question on to us alone.
  void give_up_multicast(Nanoseconds now);

  bool leased() const { return leased_; }
  bool wants_multicast() const { return multicast_; }
  /// Number under which the server granted our profile.
  std::uint32_t profile() const { return profile_number_; }
  std::uint64_t session() const { return session_; }
  std::uint64_t token() const { return token_; }
  /// Questions since the last answer.
  int unanswered() const { return unanswered_; }
  /// Why there is no lease, for a person.
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
  std::string problem_{"not asked yet"};
};

/// What these options ask a server to send.
/// @throw std::invalid_argument when it does not fit a datagram
[[nodiscard]] Profile profile_of(const ClientOptions& options);

}  // namespace fiducap::sdk
