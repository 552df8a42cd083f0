#include "streaming/native/codec.hpp"

#include <algorithm>
#include <cmath>

#include "fiducap/v1/envelope.pb.h"

namespace fiducap::native {

namespace {

// Bytes for bodies in one Model datagram; its header has at most 60 bytes.
constexpr std::size_t kModelBudget = kMaxDatagram - 80;

Datagram to_bytes(v1::Envelope& envelope) {
  envelope.set_protocol(kProtocol);
  Datagram bytes(envelope.ByteSizeLong());
  FIDUCAP_ASSERT(bytes.size() <= kMaxDatagram);
  FIDUCAP_ASSERT(envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size())));
  return bytes;
}

/// @param message  the accessor of an Envelope   @param fill  sets its fields
template <class Message, class Fill>
Datagram make_datagram(Message* (v1::Envelope::*message)(), Fill&& fill) {
  v1::Envelope envelope;
  fill(*(envelope.*message)());
  return to_bytes(envelope);
}

std::string_view name_of(v1::Envelope::MessageCase kind) {
  using Envelope = v1::Envelope;
  static constexpr std::array<std::pair<Envelope::MessageCase, std::string_view>, 11> kNames{
      {{Envelope::kSubscribe, "Subscribe"},
       {Envelope::kChallenge, "Challenge"},
       {Envelope::kLease, "Lease"},
       {Envelope::kUnsubscribe, "Unsubscribe"},
       {Envelope::kModel, "Model"},
       {Envelope::kFrame, "Frame"},
       {Envelope::kNotice, "Notice"},
       {Envelope::kClockQuery, "ClockQuery"},
       {Envelope::kClockReply, "ClockReply"},
       {Envelope::kDiscoveryQuery, "DiscoveryQuery"},
       {Envelope::kDiscoveryReply, "DiscoveryReply"}}};
  for (const auto& [known, name] : kNames)
    if (known == kind) return name;
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
  // Equivalent profiles become equal: values without effect are dropped.
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
  std::ranges::sort(profile.bodies);
  profile.bodies.erase(std::unique(profile.bodies.begin(), profile.bodies.end()),
                       profile.bodies.end());
  return profile;
}

/// Nanoseconds of a client; 0 for more than an hour.
Duration to_duration(std::uint64_t ns) {
  constexpr std::uint64_t kMost = 3'600'000'000'000;
  return Duration{ns <= kMost ? static_cast<std::int64_t>(ns) : 0};
}

Expected<void> check_size(std::string_view name, std::size_t least, std::size_t size) {
  if (size >= least) return {};
  return fail(ErrorCode::kInvalid, std::string(name) + " must be padded to " +
                                       std::to_string(least) + " bytes, got " +
                                       std::to_string(size));
}

Expected<Request> to_request(const v1::Subscribe& in, std::size_t size) {
  if (const auto padded = check_size("Subscribe", kMinSubscribe, size); !padded)
    return tl::unexpected(padded.error());
  if (in.client_name().size() > kMaxClientName)
    return fail(ErrorCode::kInvalid, "client name must have at most " +
                                         std::to_string(kMaxClientName) + " bytes, got " +
                                         std::to_string(in.client_name().size()));
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
  if (datagram.size() > kMaxDatagram)
    return fail(ErrorCode::kInvalid, "datagram must have at most " + std::to_string(kMaxDatagram) +
                                         " bytes, got " + std::to_string(datagram.size()));
  v1::Envelope envelope;
  if (!envelope.ParseFromArray(datagram.data(), static_cast<int>(datagram.size())))
    return fail(ErrorCode::kTruncated, "expected an Envelope, the " +
                                           std::to_string(datagram.size()) +
                                           " bytes received end too early or are not protobuf");
  if (envelope.protocol() != kProtocol)
    return fail(ErrorCode::kUnsupported, "expected protocol " + std::to_string(kProtocol) +
                                             ", got " + std::to_string(envelope.protocol()));
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
              "expected Subscribe, Unsubscribe, ClockQuery or DiscoveryQuery, got " +
                  std::string(name_of(envelope.message_case())));
}

Datagram encode(const ChallengeAnswer& challenge) {
  return make_datagram(&v1::Envelope::mutable_challenge, [&](auto& out) {
    out.set_token(challenge.token);
    out.set_nonce(challenge.nonce);
    out.set_session(challenge.session);
  });
}

Datagram encode(const LeaseAnswer& lease) {
  return make_datagram(&v1::Envelope::mutable_lease, [&](auto& out) {
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
  });
}

Datagram encode(const ClockAnswer& answer) {
  return make_datagram(&v1::Envelope::mutable_clock_reply, [&](auto& out) {
    out.set_session(answer.session);
    out.set_number(answer.number);
    out.set_received_at_ns(to_ns(answer.received_at));
    out.set_sent_at_ns(to_ns(answer.sent_at));
  });
}

Datagram encode_discovery(std::uint64_t nonce, std::uint64_t session, const ServerCard& card) {
  return make_datagram(&v1::Envelope::mutable_discovery_reply, [&](auto& out) {
    out.set_nonce(nonce);
    out.set_session(session);
    out.set_host(card.host.substr(0, kMaxHostName));
    out.set_version(card.version.substr(0, kMaxVersion));
    out.set_body_count(card.body_count);
    out.set_rate_hz(static_cast<float>(card.rate_hz));
    out.set_port(card.port);
  });
}

Datagram encode_notice(std::uint64_t session, std::uint64_t nonce, NoticeReason reason,
                       std::string_view text) {
  return make_datagram(&v1::Envelope::mutable_notice, [&](auto& out) {
    out.set_session(session);
    out.set_nonce(nonce);
    out.set_reason(static_cast<v1::Notice::Reason>(reason));
    out.set_text(std::string(text));
  });
}

std::vector<Datagram> encode_model(std::uint64_t session, const SceneModel& model,
                                   std::uint32_t profile) {
  FIDUCAP_ASSERT(model.bodies.size() <= kMaxBodies);
  std::vector<v1::Envelope> parts;
  std::size_t used = kModelBudget + 1;  // over the budget: the first body opens the first part
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
