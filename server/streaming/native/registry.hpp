#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "streaming/native/answer_limiter.hpp"
#include "streaming/native/codec.hpp"
#include "streaming/native/peer.hpp"
#include "streaming/native/token_mint.hpp"

namespace fiducap::native {

struct RegistryLimits {
  int max_clients{64};
  int max_clients_per_address{16};
  Duration lease{std::chrono::seconds(3)};
};

/// A client that proved its address and has time left.
struct Subscriber {
  Peer peer;
  std::string name;  ///< As it calls itself; printable ASCII, may be empty.
  Instant since{};
  Instant lease_until{};
  std::optional<Instant> model_sent_at;
  std::uint64_t frames_sent{};
  std::uint64_t frames_dropped{};  ///< The socket's buffer was full.
  std::uint64_t lost_on_the_way{}; ///< As the client reports.
};

/// Datagrams that got no answer, by reason.
struct Unanswered {
  std::uint64_t malformed{};
  std::uint64_t too_often{};
};

/// The conversation with all clients: datagram in → datagram out, time passed in, no socket.
///
/// Nothing is remembered about an address before it returned a token, and it is answered at most once per question,
/// never with more bytes than came. At most `max_clients` are remembered; the lease ends those that fall silent.
class Registry final {
 public:
  /// @param key, session  random for each start of the server; session is not 0
  Registry(const RegistryLimits& limits, const std::array<std::uint64_t, 2>& key, std::uint64_t session);

  enum class Event { kNone, kJoined, kLeft };
  struct Reply {
    Datagram datagram;      ///< Empty: no answer.
    bool send_model{};      ///< All Model datagrams follow the answer.
    Event event{Event::kNone};
  };
  [[nodiscard]] Reply receive(std::span<const std::byte> datagram, const Peer& from, std::uint64_t model_generation,
                              Instant now);
  /// Forgets everyone whose lease is over. @return how many.
  std::size_t expire(Instant now);

  /// In the order of arrival. Counters may be changed, nothing else.
  [[nodiscard]] std::span<Subscriber> subscribers() { return subscribers_; }
  [[nodiscard]] std::span<const Subscriber> subscribers() const { return subscribers_; }
  [[nodiscard]] const Unanswered& unanswered() const { return unanswered_; }
  [[nodiscard]] std::uint64_t session() const { return session_; }

 private:
  [[nodiscard]] Reply on(const SubscribeRequest& request, const Peer& from, std::uint64_t model_generation,
                         std::size_t bytes_in, Instant now);
  [[nodiscard]] Reply on(const UnsubscribeRequest& request, const Peer& from, Instant now);
  [[nodiscard]] Reply challenge(const SubscribeRequest& request, const Peer& from, std::size_t bytes_in, Instant now);
  [[nodiscard]] std::optional<NoticeReason> reason_to_refuse(const Peer& from) const;
  [[nodiscard]] Reply refuse(const SubscribeRequest& request, NoticeReason reason, std::size_t bytes_in) const;
  [[nodiscard]] Subscriber* find(const Peer& peer);

  RegistryLimits limits_;
  TokenMint mint_;
  std::uint64_t session_;
  AnswerLimiter limiter_;
  Unanswered unanswered_;
  std::vector<Subscriber> subscribers_;
};

}  // namespace fiducap::native
