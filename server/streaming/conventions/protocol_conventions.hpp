#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"

namespace fiducap {

/// What clients get of a body whose pose is not valid.
enum class WhenInvalid {
  /// Marked invalid as its protocol does it (ProtocolConventions::invalid_looks), with the numbers
  /// of the original server. For clients that ignore the mark use kStop.
  kFlag,
  kStop,  ///< The body is absent until it is valid again.
  kHold,  ///< The last valid pose is repeated as valid, for clients that need one; never a default.
};

namespace words {

inline constexpr std::array<Word<WhenInvalid>, 3> kWhenInvalid{
    {{"flag", WhenInvalid::kFlag}, {"stop", WhenInvalid::kStop}, {"hold", WhenInvalid::kHold}}};

}  // namespace words

/// How clients of one protocol expect a pose; defaults of the configuration.
struct ProtocolConventions {
  std::string_view protocol;
  OutputAxes axes;
  std::string_view attitude;  ///< On the wire: `xyzw`, `wxyz`, `matrix`, `angles`.
  WhenInvalid when_invalid{WhenInvalid::kFlag};
  std::string_view invalid_looks;  ///< How a client recognises it under `when_invalid`.
  NameRule names;
  std::string_view stamp;  ///< Meaning of the wire's time stamp.
};

inline constexpr OutputAxes kMetres{UpAxis::kZ, AxesScope::kWorld, 1.0};
/// The commercial server's default; its drivers rotate the body's axes back with the world's.
inline constexpr OutputAxes kMetresYUp{UpAxis::kY, AxesScope::kWorldAndBody, 1.0};
inline constexpr OutputAxes kMillimetres{UpAxis::kZ, AxesScope::kWorld, 1000.0};
inline constexpr OutputAxes kAutopilot{UpAxis::kDown, AxesScope::kWorldAndBody, 1.0};
inline constexpr NameRule kRosNames{90, "-./~{}:\\", true, false};

inline constexpr std::array<ProtocolConventions, 9> kProtocolConventions{{
    {"vrpn", kMetres, "xyzw", WhenInvalid::kStop, "no reports", {95, "@"}, "UTC of the pose"},
    {"natnet",
     kMetresYUp,
     "xyzw",
     WhenInvalid::kFlag,
     "tracking-valid bit clear, mean error 0, last pose kept",
     {255, ","},
     "server seconds of the pose; exposure and transmit in ticks"},
    {"vicon",
     kMillimetres,
     "matrix",
     WhenInvalid::kFlag,
     "occluded",
     {127, "!\"#$%&'()*+,-./:;<=>?@[\\]^`{|}~", true, false},
     "frame number = time of the pose x rate; total latency counts back to that time"},
    {"vicon_udp",
     kMillimetres,
     "angles",
     WhenInvalid::kStop,
     "absent",
     {23, "!\"#$%&'()*+,-./:;<=>?@[\\]^`{|}~", true, false},
     "no time, only a frame number"},
    {"qualisys",
     kMillimetres,
     "matrix",
     WhenInvalid::kFlag,
     "NaN",
     {255, "<>&\"'"},
     "server microseconds of the pose"},
    {"ros2", kMetres, "xyzw", WhenInvalid::kStop, "no messages; diagnostics say why", kRosNames,
     "UTC of the pose"},
    {"px4", kAutopilot, "wxyz", WhenInvalid::kStop, "no messages", kRosNames, "UTC of the pose"},
    {"mavlink",
     kAutopilot,
     "wxyz",
     WhenInvalid::kStop,
     "no messages",
     {0, "", true},
     "server time of the pose; TIMESYNC ties it to the autopilot's"},
    {"native",
     kMetres,
     "wxyz",
     WhenInvalid::kFlag,
     "valid = false",
     {128},
     "server nanoseconds of the pose, with its offset to UTC"},
}};

[[nodiscard]] constexpr const ProtocolConventions& conventions_of(std::string_view protocol) {
  for (const auto& one : kProtocolConventions)
    if (one.protocol == protocol) return one;
  return kProtocolConventions.back();
}

/// A socket that a protocol opens.
struct PortUse {
  std::uint16_t number{};  ///< 0: any free one.
  bool udp{};
  std::string_view key{"port"};  ///< Of its section.
  std::uint16_t offset{};        ///< `number` minus the value of the key.
  bool optional{};               ///< The protocol is served without it, too.
  std::string address{};         ///< Where it is not that of the section.
};

/// One configured protocol: every socket that it opens, and its axes. Its other conventions: the
/// table above.
struct ServedProtocol {
  std::string_view name;
  bool enabled{};
  std::string address;
  std::vector<PortUse> ports;
  OutputAxes axes;
  WhenInvalid when_invalid{WhenInvalid::kFlag};
};

}  // namespace fiducap
