#include "src/codec.hpp"

#include <google/protobuf/arena.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "fiducap/v1/envelope.pb.h"

namespace fiducap::sdk {

namespace {

constexpr std::uint32_t kProtocol = 0x31434446;  // "FDC1"
// Limit of a server's clock: a century. The difference of a frame's time and an offset then fits.
constexpr Nanoseconds kLatestFrame = Nanoseconds{1} << 62;
constexpr Nanoseconds kLatestReply = kLatestFrame / 2;

bool lies_within(Nanoseconds t, Nanoseconds limit) { return t > -limit && t < limit; }
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Tolerance of a quaternion's norm, for rounding.
constexpr double kUnitTolerance = 1e-3;
constexpr int kCovarianceSize = 21;

/// Position of one part. @return false when it is outside its list
template <typename Message>
bool read_place(const Message& in, PartPlace& out) {
  out = {in.part_index(), in.part_count(), in.first_body(), in.body_count()};
  const auto here = static_cast<std::uint64_t>(in.bodies_size());
  return out.count >= 1 && out.count <= kMaxParts && out.index < out.count &&
         out.body_count <= kMaxBodies && out.first_body + here <= out.body_count;
}

template <typename Vector>
bool read_vector(const Vector& in, std::array<double, 3>& out) {
  out = {in.x(), in.y(), in.z()};
  return std::isfinite(out[0]) && std::isfinite(out[1]) && std::isfinite(out[2]);
}

bool read_orientation(const v1::Quaternion& in, std::array<double, 4>& out) {
  const double norm =
      std::sqrt(in.w() * in.w() + in.x() * in.x() + in.y() * in.y() + in.z() * in.z());
  if (!(std::abs(norm - 1.0) <= kUnitTolerance)) return false;
  out = {in.w(), in.x(), in.y(), in.z()};
  return true;
}

bool read_covariance(const v1::Body& in, Body& out) {
  if (in.pose_covariance_size() == 0) {  // a profile without covariance
    out.pose_covariance.fill(std::numeric_limits<float>::quiet_NaN());
    return true;
  }
  if (in.pose_covariance_size() != kCovarianceSize) return false;
  for (int i = 0; i < kCovarianceSize; ++i) {
    if (!std::isfinite(in.pose_covariance(i))) return false;
    out.pose_covariance[static_cast<std::size_t>(i)] = in.pose_covariance(i);
  }
  return true;
}

bool read_sigma(float in, double& out) {
  out = in;
  return in >= 0 && std::isfinite(in);
}

bool read_pose(const v1::Body& in, Body& out) {
  if (!in.has_position() || !in.has_orientation() || !read_covariance(in, out)) return false;
  return read_vector(in.position(), out.position_m) &&
         read_orientation(in.orientation(), out.orientation_wxyz) &&
         read_vector(in.velocity(), out.velocity_m_s) &&
         read_vector(in.body_rate(), out.body_rate_rad_s) &&
         read_vector(in.acceleration(), out.acceleration_m_s2) &&
         read_sigma(in.position_sigma(), out.position_sigma_m) &&
         read_sigma(in.rotation_sigma(), out.rotation_sigma_rad) &&
         read_sigma(in.velocity_sigma(), out.velocity_sigma_m_s) &&
         read_sigma(in.rate_sigma(), out.rate_sigma_rad_s);
}

void clear_pose(Body& out) {
  out.position_m.fill(kNan);
  out.orientation_wxyz.fill(kNan);
  out.velocity_m_s.fill(kNan);
  out.body_rate_rad_s.fill(kNan);
  out.acceleration_m_s2.fill(kNan);
  out.position_sigma_m = kNan;
  out.rotation_sigma_rad = kNan;
  out.velocity_sigma_m_s = kNan;
  out.rate_sigma_rad_s = kNan;
  out.pose_covariance.fill(std::numeric_limits<float>::quiet_NaN());
}

Tracking read_state(v1::Body::State state) {
  switch (state) {
    case v1::Body::STATE_SEARCHING:
      return Tracking::kSearching;
    case v1::Body::STATE_TRACKING:
      return Tracking::kTracking;
    case v1::Body::STATE_COASTING:
      return Tracking::kCoasting;
    default:
      return Tracking::kLost;  // STATE_LOST, and states of later versions
  }
}

bool fits_int(std::uint32_t value) {
  return value <= static_cast<std::uint32_t>(std::numeric_limits<int>::max());
}

bool read_body(const v1::Body& in, Body& out) {
  if (in.id() == 0 || !fits_int(in.id()) || !fits_int(in.tags_in_view())) return false;
  out.id = static_cast<int>(in.id());
  out.tracking = read_state(in.state());
  out.valid = in.valid();
  out.age_s = static_cast<double>(in.age_ns()) * 1e-9;
  out.tags_in_view = static_cast<int>(in.tags_in_view());
  if (out.valid) return read_pose(in, out);
  clear_pose(out);
  return true;
}

bool read_frame(const v1::Frame& in, FramePart& out) {
  if (in.session() == 0 || in.number() == 0 || in.model_generation() == 0 ||
      !read_place(in, out.place))
    return false;
  if (!lies_within(in.at_ns(), kLatestFrame) || !lies_within(in.published_at_ns(), kLatestFrame))
    return false;
  out.session = in.session();
  out.model_generation = in.model_generation();
  out.profile = in.profile();
  out.step = in.step() == 0 ? 1 : in.step();
  if (in.number() % out.step != 0) return false;
  Frame& frame = out.frame;
  frame.number = in.number();
  frame.at_server_ns = in.at_ns();
  // Unsigned, because hostile numbers may overflow.
  frame.at_utc_ns = static_cast<std::int64_t>(static_cast<std::uint64_t>(in.at_ns()) +
                                              static_cast<std::uint64_t>(in.utc_offset_ns()));
  frame.published_server_ns = in.published_at_ns();
  frame.map_version = in.map_version();
  frame.rate_hz = in.rate_hz();
  if (!(frame.rate_hz >= 0) || !std::isfinite(frame.rate_hz)) return false;
  frame.bodies.resize(static_cast<std::size_t>(in.bodies_size()));
  for (int i = 0; i < in.bodies_size(); ++i) {
    if (!read_body(in.bodies(i), frame.bodies[static_cast<std::size_t>(i)])) return false;
  }
  return true;
}

bool read_model(const v1::Model& in, ModelPart& out) {
  if (in.session() == 0 || in.generation() == 0 || !read_place(in, out.place)) return false;
  out.session = in.session();
  out.generation = in.generation();
  out.profile = in.profile();
  out.bodies.clear();
  for (const auto& body : in.bodies()) {
    if (body.id() == 0 || !fits_int(body.id()) || body.name().empty()) return false;
    out.bodies.emplace_back(static_cast<int>(body.id()), body.name());
  }
  return true;
}

bool read_lease(const v1::Lease& in, Lease& out) {
  out = {};
  out.session = in.session();
  out.nonce = in.nonce();
  out.token = in.token();
  out.lease = in.lease_ms() * kMillisecond;
  out.model_generation = in.model_generation();
  out.profile = in.profile();
  out.frames_dropped = in.frames_dropped();
  if (in.multicast_port() > 0xffff) return false;
  if (in.multicast_port() != 0) {
    const std::string& group = in.multicast_group();
    if (group.size() != out.group.size() || (group[0] & '\xf0') != '\xe0')
      return false;  // 224.0.0.0/4
    std::copy(group.begin(), group.end(), out.group.begin());
    out.group_port = static_cast<std::uint16_t>(in.multicast_port());
  }
  return out.session != 0 && out.token != 0 && out.lease > 0 && out.model_generation != 0;
}

bool read_discovery(const v1::DiscoveryReply& in, DiscoveryReply& out) {
  if (in.session() == 0 || in.port() == 0 || in.port() > 0xffff || !std::isfinite(in.rate_hz()))
    return false;
  out = {in.nonce(),
         in.session(),
         in.host(),
         in.version(),
         0,
         in.rate_hz(),
         static_cast<std::uint16_t>(in.port())};
  out.body_count = static_cast<int>(std::min(in.body_count(), kMaxBodies));
  return true;
}

void put(const Profile& profile, v1::Profile& out) {
  out.set_up_axis(profile.y_up ? v1::Profile::UP_AXIS_Y : v1::Profile::UP_AXIS_Z);
  out.set_axes_scope(profile.turn_bodies ? v1::Profile::AXES_SCOPE_WORLD_AND_BODY
                                         : v1::Profile::AXES_SCOPE_WORLD);
  out.set_max_rate_hz(profile.max_rate_hz);
  out.set_without_covariance(profile.without_covariance);
  for (const auto& name : profile.bodies) out.add_bodies(name);
}

std::vector<std::uint8_t> to_bytes(v1::Envelope& envelope) {
  envelope.set_protocol(kProtocol);
  std::vector<std::uint8_t> bytes(envelope.ByteSizeLong());
  if (!envelope.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()))) {
    throw std::logic_error("fiducap: a request exceeds its size");
  }
  return bytes;
}

/// In an arena, because the destructor of a message with a oneof deletes a pointer that was never
/// set when the member's allocation has failed.
template <typename Fill>
std::vector<std::uint8_t> make_datagram(Fill&& fill) {
  google::protobuf::Arena arena;
  auto& envelope = *google::protobuf::Arena::CreateMessage<v1::Envelope>(&arena);
  fill(envelope);
  return to_bytes(envelope);
}

}  // namespace

/// One arena in one block that fits every regular datagram; it grows for the others only while they
/// are decoded.
class Decoder::Scratch {
 public:
  Scratch() : block_(32 * 1024), arena_(options(block_)) {}

  /// @return nullptr when the bytes are not an envelope of this protocol
  const v1::Envelope* parse(const std::uint8_t* bytes, std::size_t size) {
    arena_.Reset();
    envelope_ = google::protobuf::Arena::CreateMessage<v1::Envelope>(&arena_);
    if (size > kMaxDatagram || !envelope_->ParseFromArray(bytes, static_cast<int>(size)))
      return nullptr;
    return envelope_->protocol() == kProtocol ? envelope_ : nullptr;
  }
  const v1::Envelope& envelope() const { return *envelope_; }

 private:
  static google::protobuf::ArenaOptions options(std::vector<char>& block) {
    google::protobuf::ArenaOptions made;
    made.initial_block = block.data();
    made.initial_block_size = block.size();
    return made;
  }

  std::vector<char> block_;
  google::protobuf::Arena arena_;
  v1::Envelope* envelope_{nullptr};
};

Decoder::Decoder() : scratch_(std::make_unique<Scratch>()) {}

Decoder::~Decoder() = default;

MessageKind Decoder::decode(const std::uint8_t* bytes, std::size_t size) {
  if (scratch_->parse(bytes, size) == nullptr) return MessageKind::kNone;
  return read(*scratch_);
}

MessageKind Decoder::read(const Scratch& scratch) {
  const v1::Envelope& in = scratch.envelope();
  switch (in.message_case()) {
    case v1::Envelope::kChallenge:
      challenge_ = {in.challenge().token(), in.challenge().nonce(), in.challenge().session()};
      return challenge_.token != 0 && challenge_.session != 0 ? MessageKind::kChallenge
                                                              : MessageKind::kNone;
    case v1::Envelope::kLease:
      return read_lease(in.lease(), lease_) ? MessageKind::kLease : MessageKind::kNone;
    case v1::Envelope::kModel:
      return read_model(in.model(), model_) ? MessageKind::kModel : MessageKind::kNone;
    case v1::Envelope::kFrame:
      return read_frame(in.frame(), frame_) ? MessageKind::kFrame : MessageKind::kNone;
    case v1::Envelope::kNotice:
      notice_ = {in.notice().session(), in.notice().nonce(),
                 in.notice().reason() == v1::Notice::REASON_SHUTTING_DOWN, in.notice().text()};
      return notice_.session != 0 ? MessageKind::kNotice : MessageKind::kNone;
    case v1::Envelope::kClockReply: {
      const auto& reply = in.clock_reply();
      clock_reply_ = {reply.session(), reply.number(), reply.received_at_ns(), reply.sent_at_ns()};
      return clock_reply_.session != 0 && lies_within(reply.received_at_ns(), kLatestReply) &&
                     lies_within(reply.sent_at_ns(), kLatestReply)
                 ? MessageKind::kClockReply
                 : MessageKind::kNone;
    }
    case v1::Envelope::kDiscoveryReply:
      return read_discovery(in.discovery_reply(), discovery_reply_) ? MessageKind::kDiscoveryReply
                                                                    : MessageKind::kNone;
    default:
      return MessageKind::kNone;
  }
}

std::vector<std::uint8_t> encode(const SubscribeRequest& request) {
  return make_datagram([&](v1::Envelope& envelope) {
    auto& out = *envelope.mutable_subscribe();
    out.set_token(request.token);
    out.set_nonce(request.nonce);
    out.set_model_generation(request.model_generation);
    out.set_client_name(request.client_name.substr(0, kMaxClientName));
    out.set_frames_received(request.frames_received);
    out.set_frames_lost(request.frames_lost);
    if (!request.profile.is_default()) put(request.profile, *out.mutable_profile());
    out.set_multicast(request.multicast);
    out.set_clock_offset_ns(request.clock_offset);
    out.set_clock_sigma_ns(static_cast<std::uint64_t>(request.clock_sigma));
    out.set_latency_p99_ns(static_cast<std::uint64_t>(request.latency_p99));
    if (envelope.ByteSizeLong() < kMinSubscribe) out.set_padding(std::string(kMinSubscribe, '\0'));
  });
}

std::vector<std::uint8_t> encode_unsubscribe(std::uint64_t token) {
  return make_datagram(
      [&](v1::Envelope& envelope) { envelope.mutable_unsubscribe()->set_token(token); });
}

std::array<std::uint8_t, 64> encode_clock_query(std::uint64_t token, std::uint64_t number) {
  std::array<std::uint8_t, 64> bytes{};
  std::size_t at = 0;
  const auto put_fixed = [&](std::uint8_t tag, std::uint64_t value, int size) {
    bytes[at++] = tag;
    for (int i = 0; i < size; ++i) bytes[at++] = static_cast<std::uint8_t>(value >> (8 * i));
  };
  put_fixed(0x0d, kProtocol, 4);
  bytes[at++] = 0x82;  // field 16, with length: all that follows
  bytes[at++] = 0x01;
  bytes[at++] = static_cast<std::uint8_t>(bytes.size() - 8);
  put_fixed(0x09, token, 8);
  put_fixed(0x11, number, 8);
  bytes[at++] = 0x1a;  // padding
  bytes[at] = static_cast<std::uint8_t>(bytes.size() - at - 1);
  return bytes;
}

std::vector<std::uint8_t> encode_discovery_query(std::uint64_t nonce) {
  return make_datagram([&](v1::Envelope& envelope) {
    envelope.mutable_discovery_query()->set_nonce(nonce);
    envelope.mutable_discovery_query()->set_padding(std::string(kMinDiscovery, '\0'));
  });
}

}  // namespace fiducap::sdk
