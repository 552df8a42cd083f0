#include "streaming/vrpn/codec.hpp"

#include <algorithm>
#include <numbers>

#include "base/bytes.hpp"
#include "base/text.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::vrpn {

namespace {

constexpr std::string_view kMagic = "vrpn: ver. ";
constexpr std::size_t kMajorOffset = 11;
constexpr std::size_t kMinorOffset = 14;
constexpr std::size_t kLogModeOffset = 18;
constexpr std::int64_t kNsPerSecond = 1'000'000'000;

constexpr std::size_t padded(std::size_t payload) { return (payload + 7) / 8 * 8; }

BigEndianWriter begin(const Header& header, std::size_t payload, std::vector<std::byte>& out) {
  const std::int64_t utc_ns = std::max<std::int64_t>(header.utc_ns, 0);
  BigEndianWriter to(out);
  to.u32(static_cast<std::uint32_t>(kHeaderSize + payload))
      .u32(static_cast<std::uint32_t>(utc_ns / kNsPerSecond))
      .u32(static_cast<std::uint32_t>(utc_ns % kNsPerSecond / 1000))
      .i32(header.sender)
      .i32(header.type)
      .u32(header.sequence);
  return to;
}

void put(BigEndianWriter& to, int v) { to.i32(v); }
void put(BigEndianWriter& to, double v) { to.f64(v); }
void put(BigEndianWriter& to, const Eigen::Vector3d& v) { to.f64(v.x()).f64(v.y()).f64(v.z()); }
void put(BigEndianWriter& to, const Eigen::Quaterniond& q) {
  to.f64(q.x()).f64(q.y()).f64(q.z()).f64(q.w());
}
void put(BigEndianWriter& to, const Pose& X) {
  put(to, X.p);
  put(to, X.q);
}
template <typename... Parts>
void put_all(BigEndianWriter to, const Parts&... parts) {
  (put(to, parts), ...);
}

void put(std::span<std::byte> at, std::uint32_t v) {
  for (std::size_t i = 0; i < 4; ++i) at[i] = static_cast<std::byte>(v >> (24 - 8 * i));
}

std::string_view as_text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Short and printable, for an error's text.
std::string shown(std::string_view text) { return "\"" + printable(text, 40) + "\""; }

Expected<std::uint16_t> checked_port(std::int64_t port, const char* context) {
  if (port >= kLowestPort && port <= 65535) return static_cast<std::uint16_t>(port);
  return fail(ErrorCode::kInvalid,
              "expected a port from 1024 to 65535, got " + std::to_string(port), context);
}

const Pose kAtPivot{Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
// A rotation of pi or more within dt would be read as one in the other direction.
constexpr double kLargestRotation_rad = 0.9 * std::numbers::pi;

double rotation_time_s(double rate_rad_s) {
  return rate_rad_s <= kLargestRotation_rad ? 1.0 : kLargestRotation_rad / rate_rad_s;
}

}  // namespace

void encode_cookie(int minor, std::vector<std::byte>& out) {
  const char digits[] = {static_cast<char>('0' + minor / 10 % 10),
                         static_cast<char>('0' + minor % 10)};
  BigEndianWriter(out).text(kMagic).text("07.").text({digits, 2}).text("  0").zeros(5);
}

void encode_description(const Header& header, std::string_view name, std::vector<std::byte>& out) {
  const std::size_t n = name.size() + 1;
  begin(header, 4 + n, out)
      .u32(static_cast<std::uint32_t>(n))
      .text(name)
      .zeros(1 + padded(4 + n) - (4 + n));
}

void encode_empty(const Header& header, std::vector<std::byte>& out) { begin(header, 0, out); }

void encode_pos_quat(const Header& header, int sensor, const Pose& X, std::vector<std::byte>& out) {
  put_all(begin(header, 64, out), sensor, sensor, X);
}

void encode_rate(const Header& header, int sensor, const Eigen::Vector3d& rate,
                 const Eigen::Quaterniond& rotation, double dt_s, std::vector<std::byte>& out) {
  put_all(begin(header, 72, out), sensor, sensor, rate, rotation, dt_s);
}

void encode_to_room(const Header& header, const Pose& X, std::vector<std::byte>& out) {
  put_all(begin(header, 56, out), X);
}

void encode_unit_to_sensor(const Header& header, int sensor, const Pose& X,
                           std::vector<std::byte>& out) {
  put_all(begin(header, 64, out), sensor, 0, X);
}

void encode_workspace(const Header& header, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                      std::vector<std::byte>& out) {
  put_all(begin(header, 48, out), low, high);
}

void encode_text(const Header& header, const TextMessage& message, std::vector<std::byte>& out) {
  const std::string_view text = message.text.substr(0, kMaxTextBytes);
  const std::size_t payload = 8 + text.size() + 1;
  begin(header, payload, out)
      .u32(static_cast<std::uint32_t>(message.severity))
      .u32(message.level)
      .text(text)
      .zeros(1 + padded(payload) - payload);
}

void number_messages(std::span<std::byte> bytes, std::uint32_t& next) {
  while (bytes.size() >= kHeaderSize) {
    const std::size_t length = BigEndianReader(bytes).u32();
    put(bytes.subspan(kSequenceOffset, 4), next++);
    bytes = bytes.subspan(kHeaderSize + padded(length - kHeaderSize));
  }
}

Expected<std::size_t> occupied_size(std::span<const std::byte> in) {
  if (in.size() < 4) return 0;
  const std::size_t length = BigEndianReader(in).u32();
  if (length < kHeaderSize || length > kHeaderSize + kMaxPayload)
    return fail(ErrorCode::kInvalid,
                "expected a length from 24 to " + std::to_string(kHeaderSize + kMaxPayload) +
                    ", got " + std::to_string(length),
                "VRPN message");
  return kHeaderSize + padded(length - kHeaderSize);
}

Expected<Message> decode_message(std::span<const std::byte> in) {
  const auto size = occupied_size(in);
  if (!size) return tl::unexpected(size.error());
  BigEndianReader from(in);
  const std::size_t length = from.u32();
  const std::int64_t seconds = from.u32();
  const std::int64_t microseconds = from.u32();
  Message message;
  message.header.utc_ns = seconds * kNsPerSecond + microseconds * 1000;
  message.header.sender = from.i32();
  message.header.type = from.i32();
  message.header.sequence = from.u32();
  message.size = *size;
  if (!from.failed()) message.payload = from.bytes(*size - kHeaderSize);
  if (auto whole = from.check("VRPN message"); !whole) return tl::unexpected(whole.error());
  message.payload = message.payload.first(length - kHeaderSize);
  return message;
}

Expected<Cookie> decode_cookie(std::span<const std::byte> in) {
  BigEndianReader from(in);
  const std::string_view text = as_text(from.bytes(kCookieSize));
  if (auto whole = from.check("VRPN cookie"); !whole) return tl::unexpected(whole.error());
  const char log_mode = text[kLogModeOffset];
  const bool form = text.starts_with(kMagic) && text[kMinorOffset - 1] == '.' &&
                    is_digit(text[kMinorOffset]) && is_digit(text[kMinorOffset + 1]) &&
                    log_mode >= '0' && log_mode <= '3';
  if (!form)
    return fail(ErrorCode::kInvalid, "expected \"vrpn: ver. 07.NN  0\", got " + shown(text),
                "VRPN cookie");
  if (text.substr(kMajorOffset, 2) != "07")
    return fail(ErrorCode::kUnsupported,
                "this server speaks VRPN 07, the client " + shown(text.substr(kMajorOffset, 5)),
                "VRPN cookie");
  return Cookie{(text[kMinorOffset] - '0') * 10 + (text[kMinorOffset + 1] - '0'), log_mode - '0'};
}

Expected<std::string_view> decode_name(std::span<const std::byte> payload) {
  BigEndianReader from(payload);
  from.u32();
  const std::string_view name = until_zero(from.bytes(from.left()));
  if (auto whole = from.check("VRPN description"); !whole) return tl::unexpected(whole.error());
  // libvrpn holds names in 100 bytes.
  if (name.empty() || name.size() > 100)
    return fail(ErrorCode::kInvalid,
                "expected a name of 1 to 100 bytes, got " + std::to_string(name.size()),
                "VRPN description");
  return name;
}

Expected<std::uint16_t> decode_udp_description(const Message& message) {
  const std::string_view address = until_zero(message.payload);
  const bool form = !address.empty() && address.size() < message.payload.size() &&
                    std::ranges::all_of(address, [](char c) { return is_digit(c) || c == '.'; });
  if (!form)
    return fail(ErrorCode::kInvalid,
                "expected a dotted quad and a zero, got " + shown(as_text(message.payload)),
                "VRPN UDP description");
  return checked_port(message.header.sender, "VRPN UDP description");
}

Expected<TextMessage> decode_text(std::span<const std::byte> payload) {
  BigEndianReader from(payload);
  const std::uint32_t severity = from.u32();
  const std::uint32_t level = from.u32();
  if (auto whole = from.check("VRPN text"); !whole) return tl::unexpected(whole.error());
  if (severity > static_cast<std::uint32_t>(Severity::kError))
    return fail(ErrorCode::kInvalid,
                "expected a severity from 0 to 2, got " + std::to_string(severity), "VRPN text");
  const std::span<const std::byte> rest = from.bytes(from.left());
  const std::string_view text = until_zero(rest);
  if (text.size() == rest.size())
    return fail(ErrorCode::kTruncated,
                "expected a text that ends with a zero, got " + std::to_string(rest.size()) +
                    " bytes without one",
                "VRPN text");
  return TextMessage{static_cast<Severity>(severity), level, text};
}

Expected<std::uint16_t> decode_request(std::span<const std::byte> datagram) {
  constexpr const char* kContext = "VRPN connection request";
  const std::string_view text = until_zero(datagram);
  const std::size_t space = text.find(' ');
  const auto in_host = [](char c) { return is_digit(c) || c == '.' || is_letter(c); };
  const std::string_view host = text.substr(0, space);
  const std::string_view digits =
      space == std::string_view::npos ? std::string_view{} : text.substr(space + 1);
  const bool ends = text.size() < datagram.size();
  const auto port = whole_number<std::uint32_t>(digits);
  if (!ends || host.empty() || !std::ranges::all_of(host, in_host) || !port)
    return fail(ErrorCode::kInvalid,
                "expected \"a.b.c.d PORT\" and a zero, got " + shown(as_text(datagram)), kContext);
  return checked_port(*port, kContext);
}

std::size_t EncodedFrame::equal_cut() const {
  if (datagram_ends.size() < 2) return 0;
  const std::size_t cut = datagram_ends.front();
  for (std::size_t i = 0; i + 1 < datagram_ends.size(); ++i)
    if (datagram_ends[i] != (i + 1) * cut) return 0;
  return bytes.size() - datagram_ends[datagram_ends.size() - 2] <= cut ? cut : 0;
}

void ReportEncoder::encode(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
                           std::span<const std::vector<Pose>> sensors_of_body,
                           EncodedFrame& out) const {
  out.bytes.clear();
  out.datagram_ends.clear();
  const std::int64_t utc_ns = frame.utc_ns();
  const std::size_t count = std::min(frame.bodies.size(), sender_of_body.size());
  std::size_t datagram_begin = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!frame.bodies[i].valid || sender_of_body[i] < 0) continue;
    const std::size_t body_begin = out.bytes.size();
    const BodyPose& body = frame.bodies[i];
    append(body, kAtPivot, {utc_ns, sender_of_body[i], 0}, out.bytes);
    if (i < sensors_of_body.size()) {
      int sensor = 0;
      for (const Pose& X_PS : sensors_of_body[i])
        append(body, X_PS, {utc_ns, sender_of_body[i], ++sensor}, out.bytes);
    }
    // The reports of one body stay together.
    if (out.bytes.size() - datagram_begin > kMaxDatagram) {
      out.datagram_ends.push_back(body_begin);
      datagram_begin = body_begin;
    }
  }
  if (out.bytes.size() > datagram_begin) out.datagram_ends.push_back(out.bytes.size());
}

void ReportEncoder::append(const BodyPose& body, const Pose& X_PS, const Stamp& stamp,
                           std::vector<std::byte>& out) const {
  const auto header = [&](Type type) { return header_of(stamp.utc_ns, stamp.sender, type); };
  const Eigen::Quaterniond& q_WP = body.X_WP.q;
  const Pose X = axes_.pose({q_WP * X_PS.q, body.X_WP.p + q_WP * X_PS.p});
  // Clients do not check for NaN.
  if (!X.p.allFinite() || !X.q.coeffs().allFinite()) return;
  encode_pos_quat(header(Type::kPosQuat), stamp.sensor, X, out);
  const Eigen::Vector3d lever = body.w_WP_P.cross(X_PS.p);
  const Eigen::Vector3d v = axes_.length(body.v_WP + q_WP * lever);
  const Eigen::Vector3d w = axes_.world_rate(q_WP * body.w_WP_P);
  if (content_.velocity && v.allFinite() && w.allFinite()) {
    const double dt_s = rotation_time_s(w.norm());
    encode_rate(header(Type::kVelocity), stamp.sensor, v, exp_so3(w * dt_s), dt_s, out);
  }
  const Eigen::Vector3d a = axes_.length(body.a_WP + q_WP * body.w_WP_P.cross(lever));
  if (content_.acceleration && a.allFinite())
    encode_rate(header(Type::kAcceleration), stamp.sensor, a, Eigen::Quaterniond::Identity(), 1.0,
                out);
}

}  // namespace fiducap::vrpn
