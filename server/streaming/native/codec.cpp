#include "streaming/native/codec.hpp"

#include <algorithm>

#include "base/assert.hpp"
#include "fiducap/v1/envelope.pb.h"

namespace fiducap::native {

namespace {

// Least bytes of one Model datagram that are left for bodies: the rest is its header (at most 60 bytes).
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
    case v1::Envelope::kSubscribe: return "Subscribe";
    case v1::Envelope::kChallenge: return "Challenge";
    case v1::Envelope::kLease: return "Lease";
    case v1::Envelope::kUnsubscribe: return "Unsubscribe";
    case v1::Envelope::kModel: return "Model";
    case v1::Envelope::kFrame: return "Frame";
    case v1::Envelope::kNotice: return "Notice";
    case v1::Envelope::MESSAGE_NOT_SET: return "no known message";
  }
  return "no known message";
}

Expected<Request> to_request(const v1::Subscribe& in, std::size_t size) {
  if (size < kMinSubscribe) {
    return fail(ErrorCode::kInvalid, "Subscribe must be padded to " + std::to_string(kMinSubscribe) +
                                         " bytes, came with " + std::to_string(size));
  }
  if (in.client_name().size() > kMaxClientName) {
    return fail(ErrorCode::kInvalid, "client name must have at most " + std::to_string(kMaxClientName) +
                                         " bytes, came with " + std::to_string(in.client_name().size()));
  }
  return SubscribeRequest{in.token(), in.nonce(), in.model_generation(), in.client_name(), in.frames_lost()};
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
    return fail(ErrorCode::kTruncated, "expected an Envelope, the " + std::to_string(datagram.size()) +
                                           " bytes that came end too early or are not protobuf");
  }
  if (envelope.protocol() != kProtocol) {
    return fail(ErrorCode::kUnsupported, "expected protocol " + std::to_string(kProtocol) + ", came " +
                                             std::to_string(envelope.protocol()));
  }
  if (envelope.has_subscribe()) return to_request(envelope.subscribe(), datagram.size());
  if (envelope.has_unsubscribe()) return UnsubscribeRequest{envelope.unsubscribe().token()};
  return fail(ErrorCode::kUnsupported,
              "expected Subscribe or Unsubscribe, came " + std::string(name_of(envelope.message_case())));
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
  return to_bytes(envelope);
}

Datagram encode_notice(std::uint64_t session, std::uint64_t nonce, NoticeReason reason, std::string_view text) {
  v1::Envelope envelope;
  auto& out = *envelope.mutable_notice();
  out.set_session(session);
  out.set_nonce(nonce);
  out.set_reason(static_cast<v1::Notice::Reason>(reason));
  out.set_text(std::string(text));
  return to_bytes(envelope);
}

std::vector<Datagram> encode_model(std::uint64_t session, const SceneModel& model) {
  FIDUCAP_ASSERT(model.bodies.size() <= kMaxBodies);
  std::vector<v1::Envelope> parts;
  std::size_t used = kModelBudget + 1;  // over the budget: the first body, or none, opens the first part
  const auto open_part = [&](std::size_t first_body) {
    auto& out = *parts.emplace_back().mutable_model();
    out.set_session(session);
    out.set_generation(model.generation);
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
