#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/axes.hpp"

/// VRPN 07.xx: numbers and names, messages to bytes and back, frames to reports. Pure; big-endian.
/// Encoders append to the caller's vector, so that a reused one allocates nothing. Positions and
/// attitudes of messages are in the client's axes and metres.
namespace fiducap::vrpn {

inline constexpr std::size_t kCookieSize = 24;
inline constexpr std::size_t kHeaderSize = 24;
inline constexpr std::size_t kSequenceOffset = 20;  ///< Of the sequence number inside a header.
inline constexpr std::size_t kMaxPayload = 64000;   ///< Limit of libvrpn, and ours.
inline constexpr std::size_t kMaxDatagram = 1472;   ///< Clients disconnect at a longer one.
inline constexpr std::size_t kMaxNameBytes = 95;    ///< 96 do not work with libvrpn.
inline constexpr std::size_t kMaxTextBytes = 1023;
inline constexpr int kMaxIds = 2000;                ///< Sender ids are 0..1999.
inline constexpr std::uint16_t kLowestPort = 1024;  ///< We never connect or send to a lower port.
inline constexpr std::string_view kControlName = "VRPN Control";  ///< Sender 0; discovery skips it.

inline constexpr std::int32_t kSenderDescription = -1;
inline constexpr std::int32_t kTypeDescription = -2;
inline constexpr std::int32_t kUdpDescription = -3;

/// Our type ids: the order in which the reference server registers them.
enum class Type : std::int32_t {
  kGotFirstConnection,
  kGotConnection,
  kDroppedConnection,
  kDroppedLastConnection,
  kPosQuat,
  kVelocity,
  kAcceleration,
  kToRoom,
  kUnitToSensor,
  kRequestToRoom,
  kRequestUnitToSensor,
  kWorkspace,
  kRequestWorkspace,
  kSetUpdateRate,
  kResetOrigin,
  kText,
  kPing,
  kPong,
};

inline constexpr std::array<std::string_view, 18> kTypeNames{
    "VRPN_Connection_Got_First_Connection",
    "VRPN_Connection_Got_Connection",
    "VRPN_Connection_Dropped_Connection",
    "VRPN_Connection_Dropped_Last_Connection",
    "vrpn_Tracker Pos_Quat",
    "vrpn_Tracker Velocity",
    "vrpn_Tracker Acceleration",
    "vrpn_Tracker To_Room",
    "vrpn_Tracker Unit_To_Sensor",
    "vrpn_Tracker Request_Tracker_To_Room",
    "vrpn_Tracker Request_Unit_To_Sensor",
    "vrpn_Tracker Workspace",
    "vrpn_Tracker Request_Tracker_Workspace",
    "vrpn_Tracker set_update_rate",
    "vrpn_Tracker Reset_Origin",
    "vrpn_Base text_message",
    "vrpn_Base ping_message",
    "vrpn_Base pong_message",
};

enum class Severity : std::uint32_t { kNormal, kWarning, kError };

/// Header of a message, without its length.
struct Header {
  std::int64_t utc_ns{};  ///< On the wire: seconds and microseconds since 1970, unsigned.
  std::int32_t sender{};
  std::int32_t type{};
  std::uint32_t sequence{};
  friend bool operator==(const Header&, const Header&) = default;
};
[[nodiscard]] constexpr Header header_of(std::int64_t utc_ns, std::int32_t sender, Type type) {
  return {utc_ns, sender, static_cast<std::int32_t>(type), 0};
}

/// One framed message in the caller's buffer.
struct Message {
  Header header;
  std::span<const std::byte> payload;  ///< Without padding.
  std::size_t size{};                  ///< With padding: the next message starts there.
};

struct Cookie {
  int minor{};
  int log_mode{};  ///< 0..3; not supported.
};

struct TextMessage {
  Severity severity{};
  std::uint32_t level{};
  std::string_view text;
};

/// `vrpn: ver. 07.<minor>`, log mode 0, five zero bytes; raw, before any framed message.
void encode_cookie(int minor, std::vector<std::byte>& out);
/// `-1` or `-2` with the described id in the sender field: uint32 n, n bytes of name with its zero.
void encode_description(const Header& header, std::string_view name, std::vector<std::byte>& out);
/// No payload: pong.
void encode_empty(const Header& header, std::vector<std::byte>& out);
/// 64 bytes: int32 sensor, twice · float64 position[3] · float64 quaternion[4], x y z w.
void encode_pos_quat(const Header& header, int sensor, const Pose& X, std::vector<std::byte>& out);
/// 72 bytes, velocity or acceleration: int32 sensor, twice · float64 vector[3] · float64
/// quaternion[4], x y z w: the rotation within dt · float64 dt, seconds.
void encode_rate(const Header& header, int sensor, const Eigen::Vector3d& rate,
                 const Eigen::Quaterniond& rotation, double dt_s, std::vector<std::byte>& out);
/// 56 bytes: float64 position[3] · float64 quaternion[4], x y z w.
void encode_to_room(const Header& header, const Pose& X, std::vector<std::byte>& out);
/// 64 bytes: int32 sensor · int32 0 · float64 position[3] · float64 quaternion[4], x y z w.
void encode_unit_to_sensor(const Header& header, int sensor, const Pose& X,
                           std::vector<std::byte>& out);
/// 48 bytes: float64 min[3] · float64 max[3], metres.
void encode_workspace(const Header& header, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                      std::vector<std::byte>& out);
/// uint32 severity · uint32 level · text, zero; cut at 1023 bytes.
void encode_text(const Header& header, const TextMessage& message, std::vector<std::byte>& out);

/// Gives the messages of `bytes` consecutive sequence numbers. @pre whole messages
void number_messages(std::span<std::byte> bytes, std::uint32_t& next);

/// @return size of the first message of `in`, 0 while its length field is incomplete; Error for a
/// length below 24 or a payload above kMaxPayload
[[nodiscard]] Expected<std::size_t> occupied_size(std::span<const std::byte> in);
/// @return the first message of `in`; `kTruncated` when it is not complete.
[[nodiscard]] Expected<Message> decode_message(std::span<const std::byte> in);

/// Accepts any minor version and any bytes after the log mode. Other major versions: Error.
[[nodiscard]] Expected<Cookie> decode_cookie(std::span<const std::byte> in);
/// The name in a description, up to its zero or the end; ignores the length, which may be wrong.
[[nodiscard]] Expected<std::string_view> decode_name(std::span<const std::byte> payload);
/// @return the port in a UDP description (in the sender field); its address is not used
[[nodiscard]] Expected<std::uint16_t> decode_udp_description(const Message& message);
[[nodiscard]] Expected<TextMessage> decode_text(std::span<const std::byte> payload);
/// A connection request, `"127.0.0.1 32997\0"`. @return the port to connect to, 1024 or more.
[[nodiscard]] Expected<std::uint16_t> decode_request(std::span<const std::byte> datagram);

/// All reports of one frame for all clients; sequence numbers are 0.
struct EncodedFrame {
  std::vector<std::byte> bytes;
  std::vector<std::size_t> datagram_ends;  ///< For UDP: whole messages, at most kMaxDatagram.
  /// Length of all datagrams but the last; 0: they differ.
  [[nodiscard]] std::size_t equal_cut() const;
};

struct ReportContent {
  bool velocity{true};
  bool acceleration{false};
};

/// Encodes frames as reports of every valid body: pose and, when configured, velocity and
/// acceleration. Sensor 0 is its pivot; other sensors are rigidly attached to it. Stamps: UTC of
/// `frame.at`. The angular rate is sent as the rotation within dt = 1 s, less above 0.9 pi per
/// second (vrpn_client_ros ignores dt and is right only for 1 s). Acceleration is in world axes, 0
/// at rest; angular acceleration is not estimated (identity, 1 s).
class ReportEncoder final {
 public:
  ReportEncoder(const OutputAxes& axes, ReportContent content) : axes_(axes), content_(content) {}

  /// @param sender_of_body  in the order of frame.bodies; negative: not served.
  /// @param sensors_of_body  X_PS of sensors 1, 2, … in the order of frame.bodies; may be shorter
  /// @param out  overwritten; nothing is allocated after warm-up.
  void encode(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
              std::span<const std::vector<Pose>> sensors_of_body, EncodedFrame& out) const;

 private:
  struct Stamp {
    std::int64_t utc_ns;
    std::int32_t sender;
    int sensor;
  };
  void append(const BodyPose& body, const Pose& X_PS, const Stamp& stamp,
              std::vector<std::byte>& out) const;

  AxesChange axes_;
  ReportContent content_;
};

}  // namespace fiducap::vrpn
