#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/time.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"

/// NatNet messages except frames: requests, bytes → struct, and replies, struct → bytes.
namespace fiducap::natnet {

enum class Message : std::uint16_t {
  kConnect = 0,  // 2.x: ping
  kServerInfo = 1,
  kRequest = 2,
  kResponse = 3,
  kRequestModel = 4,
  kModel = 5,
  kRequestFrame = 6,
  kFrame = 7,
  kText = 8,
  kDisconnect = 9,
  kKeepAlive = 10,
  kDisconnectByTimeout = 11,
  kEchoRequest = 12,
  kEchoResponse = 13,
  kDiscovery = 14,
  kUnrecognized = 100,
};

inline constexpr std::size_t kHeaderSize = 4;  ///< u16 message, u16 bytes of payload.
/// One message is one datagram, limited by IPv4 UDP; only IP fragments it.
inline constexpr std::size_t kMaxDatagram = 65507;
inline constexpr std::size_t kMaxPayload = kMaxDatagram - kHeaderSize;
/// Limit of the vendor's clients.
inline constexpr std::size_t kMaxBodies = 1000;
/// Rigid body name, without its NUL.
inline constexpr std::size_t kMaxName = 255;
/// Text of a reply with its NUL: a sample client copies it into 260 bytes.
inline constexpr std::size_t kMaxText = 256;
/// Ticks per second of the server's monotonic clock. 10 MHz as in the commercial server on Windows;
/// a client that misreads SERVERINFO by 4 bytes takes its lowest byte (0x80) for the version.
inline constexpr std::uint64_t kClockFrequency = 10'000'000;
[[nodiscard]] constexpr std::int64_t ticks(Instant at) {
  return to_ns(at) / static_cast<std::int64_t>(1'000'000'000 / kClockFrequency);
}

/// Version of the byte layout for one client.
struct Bitstream {
  std::uint8_t major{};
  std::uint8_t minor{};
  auto operator<=>(const Bitstream&) const = default;
};

/// Supported versions; layouts of later ones are not public.
inline constexpr std::array<Bitstream, 13> kBitstreams{{{2, 5},
                                                        {2, 6},
                                                        {2, 7},
                                                        {2, 8},
                                                        {2, 9},
                                                        {2, 10},
                                                        {3, 0},
                                                        {3, 1},
                                                        {4, 0},
                                                        {4, 1},
                                                        {4, 2},
                                                        {4, 3},
                                                        {4, 4}}};
inline constexpr Bitstream kOldest = kBitstreams.front();
inline constexpr Bitstream kNewest = kBitstreams.back();

/// `3.1`
[[nodiscard]] std::string text_of(Bitstream version);
/// `3.1`, `3.1.0` or `3.1.0.0`. @return nullopt for any other text
[[nodiscard]] std::optional<Bitstream> parse_bitstream(std::string_view text);
[[nodiscard]] bool is_supported(Bitstream version);

/// Versions in a client's connect message; nullopt where it is too short.
struct ClientVersions {
  std::optional<Bitstream> library;  ///< The newest of its library.
  std::optional<Bitstream> wanted;   ///< 0.0: the server's choice.
};

/// From this version on a library takes unicast frames from the announced data port only (seen with
/// the vendor's 4.4; its 4.1 takes them from any port).
inline constexpr Bitstream kNeedsDataPort{4, 2};
/// From this version on a library that wants no version gets its own, as from the commercial server
/// (3.1 was not tried with it).
inline constexpr Bitstream kGetsItsOwn{4, 3};

/// The version for a unicast client: the wanted one, else its library's from kGetsItsOwn on, else
/// our default, at most its library's.
[[nodiscard]] Bitstream negotiate(const ClientVersions& client, Bitstream server_default);

/// Groups of versions with identical frames, or model definitions.
enum class FrameLayout { k2_5, k2_6, k2_7, k2_9, k3_0, k4_1 };
enum class ModelLayout { k2_5, k3_0, k4_0, k4_1, k4_2 };
inline constexpr std::size_t kModelLayouts = 5;

/// @pre is_supported(version)
[[nodiscard]] FrameLayout frame_layout(Bitstream version);
[[nodiscard]] ModelLayout model_layout(Bitstream version);

/// CONNECT (in 2.x: ping).
struct ConnectRequest {
  std::string name;  ///< From the client; printable ASCII, may be empty.
  ClientVersions versions;
  bool subscribed_data_only{};  ///< Only what it subscribes to by command.
  bool empty{};                 ///< No payload: discovery without subscription.
};
/// DISCOVERY, mostly by broadcast. Does not subscribe.
struct DiscoveryRequest {
  ClientVersions versions;
};
struct KeepAliveRequest {
  std::string name;  ///< Empty without a sender block.
  ClientVersions versions;
};
struct DisconnectRequest {};
struct EchoRequest {
  std::uint64_t client_ticks{};  ///< Opaque.
};
struct ModelRequest {
  static constexpr std::uint32_t kRigidBodies = 1U << 1;
  std::uint32_t types{~0U};  ///< Bit n: descriptions of type n.
};
struct FrameRequest {};
/// A text command, e.g. `SetProperty,drone,Active,true`.
struct CommandRequest {
  std::string_view text;  ///< Up to the first NUL, any bytes; valid as long as the datagram.
};
using Request = std::variant<ConnectRequest, DiscoveryRequest, KeepAliveRequest, DisconnectRequest,
                             EchoRequest, ModelRequest, FrameRequest, CommandRequest>;

/// The length field is unreliable: at most the received bytes are used.
/// @return nullopt for anything but a request of a client
[[nodiscard]] std::optional<Request> decode_request(std::span<const std::byte> datagram);

/// A parsed text command: `SetProperty,drone,Name,arm` → word and three arguments.
struct Command {
  static constexpr std::size_t kMostArguments = 4;

  std::string_view word;
  std::array<std::string_view, kMostArguments> arguments{};  ///< The last one may have commas.
  std::size_t count{};

  /// Empty when there are fewer.
  [[nodiscard]] std::string_view operator[](std::size_t i) const {
    return i < count ? arguments[i] : std::string_view{};
  }
};

/// Never fails: any text is a word. Word and arguments are trimmed.
[[nodiscard]] Command parse_command(std::string_view text);

using Datagram = std::vector<std::byte>;

struct ServerInfo {
  std::array<std::uint8_t, 4> application_version{};  ///< Not all 0: clients ignore such a reply.
  Bitstream bitstream;                                ///< For this client.
  std::uint16_t data_port{};                          ///< Of multicast frames.
  bool is_multicast{};
  std::array<std::uint8_t, 4> group{};  ///< First octet first; also for unicast.
};

[[nodiscard]] Datagram encode(const ServerInfo& info);
/// @param received_at  of the request, on the clock of the frames' ticks
[[nodiscard]] Datagram encode_echo(std::uint64_t client_ticks, Instant received_at);
[[nodiscard]] Datagram encode_response(std::int32_t value);
[[nodiscard]] Datagram encode_response(float value);
/// With a NUL, at most kMaxText.
[[nodiscard]] Datagram encode_text_response(std::string_view text);
/// `Bitstream,3.1.0` without a NUL: a client parses the last field up to the end.
[[nodiscard]] Datagram encode_bitstream_response(Bitstream version);
[[nodiscard]] Datagram encode_unrecognized();

/// The bodies of a scene for clients: at most kMaxBodies, with valid, distinct names short enough
/// for one MODELDEF datagram in every layout.
[[nodiscard]] std::vector<BodyDescription> announced_bodies(const SceneModel& model,
                                                            const NameRule& rule,
                                                            const NameAliases& aliases = {});

/// MODELDEF: rigid bodies without parent, offset or markers (clients add the offset to every pose).
/// @param types  bit n: descriptions of type n are requested; only type 1 exists
/// @pre bodies come from announced_bodies
[[nodiscard]] std::vector<std::byte> encode_model(std::span<const BodyDescription> bodies,
                                                  ModelLayout layout, std::uint32_t types = ~0U);

}  // namespace fiducap::natnet
