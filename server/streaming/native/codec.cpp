#include "streaming/native/codec.hpp"

#include <algorithm>
#include <cmath>

#include "base/assert.hpp"
#include "fiducap/v1/envelope.pb.h"

namespace fiducap::native {

namespace {

// Least bytes of one Model datagram that are left for bodies: the rest is its header (at most 60
// bytes).
constexpr std::size_t kModelBudget = kMaxDatagram - 80;

Datagram to_bytes(v1::Envelope& envelope) {
  envelope.set_protocol(kProtocol);
  Datagram bytes(envelope.ByteSizeLong());
  FIDUCAP_ASSERT(bytes.size() <= kMaxDatagram);
  FIDUCAP_ASSERT(envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size())));
  return bytes;
}

std::string_view name_of(v1::Envelope::MessageCase kind) {
  switch (kind) {
    case v1::Envelope::kSubscribe:
      return "Subscribe";
    case v1::Envelope::kChallenge:
      return "Challenge";
    case v1::Envelope::kLease:
      return "Lease";
    case v1::Envelope::kUnsubscribe:
      return "Unsubscribe";
    case v1::Envelope::kModel:
      return "Model";
    case v1::Envelope::kFrame:
      return "Frame";
    case v1::Envelope::kNotice:
      return "Notice";
    case v1::Envelope::kClockQuery:
      return "ClockQuery";
    case v1::Envelope::kClockReply:
      return "ClockReply";
    case v1::Envelope::kDiscoveryQuery:
      return "DiscoveryQuery";
    case v1::Envelope::kDiscoveryReply:
      return "DiscoveryReply";
    case v1::Envelope::MESSAGE_NOT_SET:
      return "no known message";
  }
  return "no known message";
}

/// @return nullopt for values that this version does not know
std::optional<Profile> to_profile(const v1::Profile& in) {
  if (!v1::Profile::UpAxis_IsValid(in.up_axis()) ||
      !v1::Profile::AxesScope_IsValid(in.axes_scope()) ||
      !v1::Profile::LengthUnit_IsValid(in.length_unit()) || !std::isfinite(in.max_rate_hz()) ||
      in.max_rate_hz() < 0 || in.bodies_size() > kMaxChosenBodies) {
    return std::nullopt;
  }
  Profile profile;
  // One meaning, one profile: what makes no difference is not kept.
  if (in.up_axis() == v1::Profile::UP_AXIS_Y) {
    profile.axes.up = UpAxis::kY;
    if (in.axes_scope() == v1::Profile::AXES_SCOPE_WORLD_AND_BODY)
      profile.axes.scope = AxesScope::kWorldAndBody;
  }
  if (in.length_unit() == v1::Profile::LENGTH_UNIT_MILLIMETRE) profile.axes.units_per_m = 1000.0;
  profile.max_rate_hz = in.max_rate_hz();
  profile.covariance = !in.without_covariance();
  for (const auto& name : in.bodies()) {
    if (name.empty() || name.size() > kMaxBodyName) return std::nullopt;
    profile.bodies.push_back(name);
  }
  std::sort(profile.bodies.begin(), profile.bodies.end());
  profile.bodies.erase(std::unique(profile.bodies.begin(), profile.bodies.end()),
                       profile.bodies.end());
  return profile;
}

/// What a stranger sends as nanoseconds: as a duration, zero when it cannot be one.
Duration to_duration(std::uint64_t ns) {
  constexpr std::uint64_t kMost = 3'600'000'000'000;  // an hour; nobody means more
  return Duration{ns <= kMost ? static_cast<std::int64_t>(ns) : 0};
}

Expected<void> check_size(std::string_view name, std::size_t least, std::size_t size) {
  if (size >= least) return {};
  return fail(ErrorCode::kInvalid, std::string(name) + " must be padded to " +
                                       std::to_string(least) + " bytes, came with " +
                                       std::to_string(size));
}

Expected<Request> to_request(const v1::Subscribe& in, std::size_t size) {
  if (const auto padded = check_size("Subscribe", kMinSubscribe, size); !padded) {
    return tl::unexpected(padded.error());
  }
  if (in.client_name().size() > kMaxClientName) {
    return fail(ErrorCode::kInvalid, "client name must have at most " +
                                         std::to_string(kMaxClientName) + " bytes, came with " +
                                         std::to_string(in.client_name().size()));
  }
  SubscribeRequest request;
  request.token = in.token();
  request.nonce = in.nonce();
  request.model_generation = in.model_generation();
  request.client_name = in.client_name();
  request.frames_lost = in.frames_lost();
  request.profile = in.has_profile() ? to_profile(in.profile()) : Profile{};
  request.multicast = in.multicast();
  request.clock_offset = Duration{in.clock_offset_ns()};
  request.clock_sigma = to_duration(in.clock_sigma_ns());
  request.latency_p99 = to_duration(in.latency_p99_ns());
  return request;
}

std::string_view cut_name(std::string_view name) {
  if (name.size() <= kMaxBodyName) return name;
  std::size_t end = kMaxBodyName;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xc0) == 0x80) --end;
  return name.substr(0, end);
}

}  // namespace

Expected<Request> decode_request(std::span<const std::byte> datagram) {
  if (datagram.size() > kMaxDatagram) {
    return fail(ErrorCode::kInvalid, "datagram must have at most " + std::to_string(kMaxDatagram) +
                                         " bytes, came with " + std::to_string(datagram.size()));
  }
  v1::Envelope envelope;
  if (!envelope.ParseFromArray(datagram.data(), static_cast<int>(datagram.size()))) {
    return fail(ErrorCode::kTruncated, "expected an Envelope, the " +
                                           std::to_string(datagram.size()) +
                                           " bytes that came end too early or are not protobuf");
  }
  if (envelope.protocol() != kProtocol) {
    return fail(ErrorCode::kUnsupported, "expected protocol " + std::to_string(kProtocol) +
                                             ", came " + std::to_string(envelope.protocol()));
  }
  if (envelope.has_subscribe()) return to_request(envelope.subscribe(), datagram.size());
  if (envelope.has_unsubscribe()) return UnsubscribeRequest{envelope.unsubscribe().token()};
  if (envelope.has_clock_query()) {
    const auto padded = check_size("ClockQuery", kMinClockQuery, datagram.size());
    if (!padded) return tl::unexpected(padded.error());
    return ClockRequest{envelope.clock_query().token(), envelope.clock_query().number()};
  }
  if (envelope.has_discovery_query()) {
    const auto padded = check_size("DiscoveryQuery", kMinDiscovery, datagram.size());
    if (!padded) return tl::unexpected(padded.error());
    return DiscoveryRequest{envelope.discovery_query().nonce()};
  }
  return fail(ErrorCode::kUnsupported,
              "expected Subscribe, Unsubscribe, ClockQuery or DiscoveryQuery, came " +
                  std::string(name_of(envelope.message_case())));
}

Datagram encode(const ChallengeAnswer& challenge) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_challenge();
  out.set_token(challenge.token);
  out.set_nonce(challenge.nonce);
  out.set_session(challenge.session);
  return to_bytes(envelope);
}

Datagram encode(const LeaseAnswer& lease) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_lease();
  out.set_session(lease.session);
  out.set_nonce(lease.nonce);
  out.set_token(lease.token);
  out.set_lease_ms(static_cast<std::uint32_t>(lease.lease / std::chrono::milliseconds(1)));
  out.set_model_generation(lease.model_generation);
  out.set_profile(lease.profile);
  if (lease.group_port != 0) {
    out.set_multicast_group(std::string(lease.group.begin(), lease.group.end()));
    out.set_multicast_port(lease.group_port);
  }
  out.set_frames_dropped(lease.frames_dropped);
  return to_bytes(envelope);
}

Datagram encode(const ClockAnswer& answer) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_clock_reply();
  out.set_session(answer.session);
  out.set_number(answer.number);
  out.set_received_at_ns(to_ns(answer.received_at));
  out.set_sent_at_ns(to_ns(answer.sent_at));
  return to_bytes(envelope);
}

Datagram encode_discovery(std::uint64_t nonce, std::uint64_t session, const ServerCard& card) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_discovery_reply();
  out.set_nonce(nonce);
  out.set_session(session);
  out.set_host(card.host.substr(0, kMaxHostName));
  out.set_version(card.version.substr(0, kMaxVersion));
  out.set_body_count(card.body_count);
  out.set_rate_hz(static_cast<float>(card.rate_hz));
  out.set_port(card.port);
  return to_bytes(envelope);
}

Datagram encode_notice(std::uint64_t session, std::uint64_t nonce, NoticeReason reason,
                       std::string_view text) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_notice();
  out.set_session(session);
  out.set_nonce(nonce);
  out.set_reason(static_cast<v1::Notice::Reason>(reason));
  out.set_text(std::string(text));
  return to_bytes(envelope);
}

std::vector<Datagram> encode_model(std::uint64_t session, const SceneModel& model,
                                   std::uint32_t profile) {
  FIDUCAP_ASSERT(model.bodies.size() <= kMaxBodies);
  std::vector<v1::Envelope> parts;
  std::size_t used =
      kModelBudget + 1;  // over the budget: the first body, or none, opens the first part
  const auto open_part = [&](std::size_t first_body) {
    auto& out = *parts.emplace_back().mutable_model();
    out.set_session(session);
    out.set_generation(model.generation);
    out.set_profile(profile);
    out.set_part_index(static_cast<std::uint32_t>(parts.size() - 1));
    out.set_first_body(static_cast<std::uint32_t>(first_body));
    out.set_body_count(static_cast<std::uint32_t>(model.bodies.size()));
    used = 0;
  };
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    v1::BodyDescription body;
    body.set_id(static_cast<std::uint32_t>(model.bodies[i].id));
    body.set_name(std::string(cut_name(model.bodies[i].name)));
    const std::size_t size = body.ByteSizeLong() + 3;  // with tag and length
    if (used + size > kModelBudget) open_part(i);
    used += size;
    *parts.back().mutable_model()->add_bodies() = std::move(body);
  }
  if (parts.empty()) open_part(0);
  std::vector<Datagram> datagrams;
  for (auto& part : parts) {
    part.mutable_model()->set_part_count(static_cast<std::uint32_t>(parts.size()));
    datagrams.push_back(to_bytes(part));
  }
  return datagrams;
}

}  // namespace fiducap::native
