#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "base/expected.hpp"
#include "streaming/natnet/bitstream.hpp"

/// What clients may send, bytes → struct. The layout of every message: wire format reference,
/// NatNet.
namespace fiducap::natnet {

/// CONNECT (in 2.x: ping).
struct ConnectRequest {
  std::string name;  ///< As the client calls itself; printable ASCII, may be empty.
  ClientVersions versions;
  bool subscribed_data_only{};  ///< Send only what it subscribes to by command.
  bool empty{};  ///< No payload: asks for the server, does not want frames by this alone.
};
/// DISCOVERY, mostly by broadcast: who is there? Never subscribes.
struct DiscoveryRequest {
  ClientVersions versions;
};
struct KeepAliveRequest {
  std::string name;  ///< Empty when it comes without the sender block.
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
/// A command in words, e.g. `SetProperty,drone,Active,true`.
struct CommandRequest {
  std::string_view text;  ///< Up to the first NUL. Any bytes; lives as long as the datagram.
};
using Request = std::variant<ConnectRequest, DiscoveryRequest, KeepAliveRequest, DisconnectRequest,
                             EchoRequest, ModelRequest, FrameRequest, CommandRequest>;

/// Lengths in the field are unreliable: the header's counts only down to what came.
/// @return Error for anything that is no request a client may send
[[nodiscard]] Expected<Request> decode_request(std::span<const std::byte> datagram);

/// A command in words, taken apart: `SetProperty,drone,Name,arm` → word and three arguments.
struct Command {
  static constexpr std::size_t kMostArguments = 4;

  std::string_view word;
  std::array<std::string_view, kMostArguments>
      arguments{};  ///< The last one takes all that is left, commas too.
  std::size_t count{};

  /// Empty when there are fewer.
  [[nodiscard]] std::string_view operator[](std::size_t i) const {
    return i < count ? arguments[i] : std::string_view{};
  }
};

/// Never fails: any text is a word. Blanks around word and arguments do not count.
[[nodiscard]] Command parse_command(std::string_view text);

}  // namespace fiducap::natnet
