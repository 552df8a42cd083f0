#include "src/conversation.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace fiducap::sdk {

namespace {

// Silence of a server after which a request is sent.
constexpr Nanoseconds kProbeAfter = 250 * kMillisecond;
// Silence after which the lease ends: four requests without a reply.
constexpr Nanoseconds kSilentAfter = 4 * kProbeAfter;
// Far more than a round trip in a local network; the cost of a lost datagram.
constexpr Nanoseconds kAnswerTimeout = 100 * kMillisecond;
// Limits the rate against a server that replies to every request with a challenge.
constexpr Nanoseconds kChallengePause = 50 * kMillisecond;

}  // namespace

Conversation::Conversation(Nanoseconds retry, std::uint64_t nonce, std::string client_name,
                           Profile profile, bool multicast)
    : retry_(retry),
      nonce_(nonce),
      client_name_(std::move(client_name)),
      profile_(std::move(profile)),
      multicast_(multicast) {}

void Conversation::start(Nanoseconds now) {
  leased_ = false;
  token_ = 0;
  unanswered_ = 0;
  challenge_used_at_ = now - kChallengePause;
  ask_at_ = now;
}

void Conversation::on(const Challenge& challenge, Nanoseconds now) {
  if (challenge.nonce != nonce_) return;
  if (challenge.session != session_) end_lease("the server was restarted");
  session_ = challenge.session;
  unanswered_ = 0;
  token_ = challenge.token;
  heard_at_ = now;
  ask_at_ = std::max(now, challenge_used_at_ + kChallengePause);
  challenge_used_at_ = ask_at_;
}

bool Conversation::on(const Lease& lease, Nanoseconds now) {
  if (lease.nonce != nonce_) return false;
  unanswered_ = 0;
  if (lease.profile == 0 && !profile_.is_default()) {
    // It would ignore the requested profile: z up, all bodies.
    end_lease("the server is too old: it does not support profiles (axes, rate, selected bodies)");
    ask_at_ = now + retry_;
    return false;
  }
  leased_ = true;
  profile_number_ = lease.profile;
  problem_.clear();
  session_ = lease.session;
  token_ = lease.token;
  lease_ = lease.lease;
  lease_until_ = now + lease.lease;
  model_generation_ = lease.model_generation;
  heard_at_ = now;
  return true;
}

void Conversation::on(const Notice& notice, Nanoseconds now) {
  const bool answers_us = notice.nonce == nonce_;
  const bool ends_us = leased_ && notice.shutting_down && notice.session == session_;
  if (!answers_us && !ends_us) return;
  unanswered_ = 0;
  end_lease("the server refused");
  problem_ = notice.text.empty() ? "the server refused the request without a reason" : notice.text;
  ask_at_ = now + retry_;
}

void Conversation::give_up_multicast(Nanoseconds now) {
  multicast_ = false;
  ask_at_ = std::min(ask_at_, now);
}

bool Conversation::heard(std::uint64_t session, Nanoseconds now) {
  if (!leased_ || session != session_) return false;
  heard_at_ = now;
  return true;
}

void Conversation::refused(Nanoseconds now) {
  end_lease("no server at this address: is fiducapd running, and is its native port this one?");
  ask_at_ = now + retry_;
}

void Conversation::tick(Nanoseconds now) {
  if (!leased_) return;
  if (now >= lease_until_ || now - heard_at_ >= kSilentAfter) {
    end_lease("the server stopped replying");
    ask_at_ = std::min(ask_at_, now);
  } else if (now - heard_at_ >= kProbeAfter && now - asked_at_ >= kProbeAfter) {
    ask_at_ = now;
  }
}

SubscribeRequest Conversation::question(std::uint64_t model_generation, Nanoseconds now) {
  ++unanswered_;
  asked_at_ = now;
  ask_at_ =
      now + pause_after_question(model_generation != 0 && model_generation == model_generation_);
  if (!leased_ && unanswered_ > 1 && problem_.empty()) problem_ = "no answer";
  SubscribeRequest request;
  request.token = token_;
  request.nonce = nonce_;
  request.model_generation = model_generation;
  request.client_name = client_name_;
  request.profile = profile_;
  request.multicast = multicast_;
  return request;
}

Nanoseconds Conversation::wake_at() const {
  if (!leased_) return ask_at_;
  const Nanoseconds probe_at = std::max(heard_at_, asked_at_) + kProbeAfter;
  return std::min({ask_at_, probe_at, heard_at_ + kSilentAfter, lease_until_});
}

void Conversation::end_lease(const char* problem) {
  leased_ = false;
  problem_ = problem;
}

Nanoseconds Conversation::pause_after_question(bool model_complete) const {
  constexpr int kQuickQuestions = 5;  // for lost datagrams; then the server is unreachable
  if (leased_ && model_complete) return std::max(lease_ / 3, kAnswerTimeout);
  if (token_ != 0 && unanswered_ <= kQuickQuestions) return std::min(retry_, kAnswerTimeout);
  return retry_;
}

Profile profile_of(const ClientOptions& options) {
  constexpr std::size_t kBytesForNames =
      900;  // of a Subscribe; the rest and the padding fit into kMaxDatagram
  Profile profile;
  profile.y_up = options.up == WorldUp::kY;
  profile.turn_bodies = profile.y_up && options.scope == TurnedAxes::kWorldAndBody;
  const bool limits_rate = std::isfinite(options.max_rate_hz) && options.max_rate_hz > 0;
  profile.max_rate_hz = limits_rate ? static_cast<float>(options.max_rate_hz) : 0.0F;
  profile.without_covariance = !options.covariance;
  profile.bodies = options.bodies;
  std::size_t bytes = 0;
  for (const auto& name : profile.bodies) {
    if (name.empty() || name.size() > kMaxBodyName) {
      throw std::invalid_argument("fiducap: the name of a body must have 1 to 128 bytes, not " +
                                  std::to_string(name.size()));
    }
    bytes += name.size() + 3;
  }
  if (profile.bodies.size() > kMaxChosenBodies || bytes > kBytesForNames) {
    throw std::invalid_argument(
        "fiducap: at most 32 bodies, with at most 900 bytes of names in total; empty: all");
  }
  return profile;
}

}  // namespace fiducap::sdk
