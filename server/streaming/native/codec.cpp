#include "streaming/native/codec.hpp"

#include <google/protobuf/arena.h>

#include <algorithm>
#include <cmath>

#include "base/expected.hpp"
#include "fiducap/v1/envelope.pb.h"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::native {

namespace {

using google::protobuf::Arena;

// Bytes for bodies in one Model datagram; its header has at most 60 bytes.
constexpr std::size_t kModelBudget = kMaxDatagram - 80;

Datagram to_bytes(v1::Envelope& envelope) {
  envelope.set_protocol(kProtocol);
  Datagram bytes(envelope.ByteSizeLong());
  FIDUCAP_ASSERT(bytes.size() <= kMaxDatagram);
  FIDUCAP_ASSERT(envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size())));
  return bytes;
}

/// Protobuf marks a member of a oneof as present before it allocates it. After a failed allocation
/// the destructor would delete a pointer that was never set; messages in an arena are not deleted.
v1::Envelope& envelope_in(Arena& arena) { return *Arena::CreateMessage<v1::Envelope>(&arena); }

/// @param message  the accessor of an Envelope   @param fill  sets its fields
template <class Message, class Fill>
Datagram make_datagram(Message* (v1::Envelope::*message)(), Fill&& fill) {
  Arena arena;
  v1::Envelope& envelope = envelope_in(arena);
  fill(*(envelope.*message)());
  return to_bytes(envelope);
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

SubscribeRequest to_request(const v1::Subscribe& in) {
  SubscribeRequest request;
  request.token = in.token();
  request.nonce = in.nonce();
  request.model_generation = in.model_generation();
  request.client_name = in.client_name();
  request.profile = in.has_profile() ? to_profile(in.profile()) : Profile{};
  request.multicast = in.multicast();
  request.report = {in.frames_lost(), Duration{in.clock_offset_ns()},
                    to_duration(in.clock_sigma_ns()), to_duration(in.latency_p99_ns())};
  return request;
}

}  // namespace

std::optional<Request> decode_request(std::span<const std::byte> datagram) {
  const std::size_t size = datagram.size();
  Arena arena;
  v1::Envelope& in = envelope_in(arena);
  if (size > kMaxDatagram || !in.ParseFromArray(datagram.data(), static_cast<int>(size)) ||
      in.protocol() != kProtocol) {
    return std::nullopt;
  }
  if (in.has_unsubscribe()) return UnsubscribeRequest{in.unsubscribe().token()};
  if (in.has_subscribe() && size >= kMinSubscribe &&
      in.subscribe().client_name().size() <= kMaxClientName)
    return to_request(in.subscribe());
  if (in.has_clock_query() && size >= kMinClockQuery)
    return ClockRequest{in.clock_query().token(), in.clock_query().number()};
  if (in.has_discovery_query() && size >= kMinDiscovery)
    return DiscoveryRequest{in.discovery_query().nonce()};
  return std::nullopt;
}

Datagram encode_challenge(std::uint64_t token, std::uint64_t nonce, std::uint64_t session) {
  return make_datagram(&v1::Envelope::mutable_challenge, [&](auto& out) {
    out.set_token(token);
    out.set_nonce(nonce);
    out.set_session(session);
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
    if (const auto& [address, port] = lease.group; port != 0) {
      out.set_multicast_group(std::string(address.begin(), address.end()));
      out.set_multicast_port(port);
    }
    out.set_frames_dropped(lease.frames_dropped);
  });
}

Datagram encode_clock(std::uint64_t session, std::uint64_t number, Instant at) {
  return make_datagram(&v1::Envelope::mutable_clock_reply, [&](auto& out) {
    out.set_session(session);
    out.set_number(number);
    out.set_received_at_ns(to_ns(at));
    out.set_sent_at_ns(to_ns(at));
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
  Arena arena;
  std::vector<v1::Envelope*> parts;
  std::size_t used = kModelBudget + 1;  // over the budget: the first body opens the first part
  const auto open_part = [&](std::size_t first_body) {
    auto& out = *parts.emplace_back(&envelope_in(arena))->mutable_model();
    out.set_session(session);
    out.set_generation(model.generation);
    out.set_profile(profile);
    out.set_part_index(static_cast<std::uint32_t>(parts.size() - 1));
    out.set_first_body(static_cast<std::uint32_t>(first_body));
    out.set_body_count(static_cast<std::uint32_t>(model.bodies.size()));
    used = 0;
  };
  for (std::size_t i = 0; i < model.bodies.size(); ++i) {
    auto* body = Arena::CreateMessage<v1::BodyDescription>(&arena);
    body->set_id(static_cast<std::uint32_t>(model.bodies[i].id));
    body->set_name(std::string(whole_characters(model.bodies[i].name, kMaxBodyName)));
    const std::size_t size = body->ByteSizeLong() + 3;  // with tag and length
    if (used + size > kModelBudget) open_part(i);
    used += size;
    parts.back()->mutable_model()->mutable_bodies()->UnsafeArenaAddAllocated(body);
  }
  if (parts.empty()) open_part(0);
  std::vector<Datagram> datagrams;
  for (auto* part : parts) {
    part->mutable_model()->set_part_count(static_cast<std::uint32_t>(parts.size()));
    datagrams.push_back(to_bytes(*part));
  }
  return datagrams;
}

}  // namespace fiducap::native
