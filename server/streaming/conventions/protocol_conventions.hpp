#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "streaming/conventions/axes.hpp"
#include "streaming/conventions/client_names.hpp"
#include "streaming/conventions/validity.hpp"

namespace fiducap {

/// How one protocol's clients expect a pose: its defaults, which the configuration may change.
struct ProtocolConventions {
  std::string_view protocol;
  OutputAxes axes;
  std::string_view attitude;  ///< `xyzw`, `wxyz` or `matrix`, as on the wire.
  WhenInvalid when_invalid{WhenInvalid::kFlag};
  std::string_view invalid_looks;  ///< How a client tells under `when_invalid`.
  NameRule names;
  std::string_view stamp;  ///< Which instant the wire's time stamp is.
};

inline constexpr OutputAxes kMetres{UpAxis::kZ, AxesScope::kWorld, 1.0};
/// As the commercial server's default; its drivers turn the body's axes back with the world's.
inline constexpr OutputAxes kMetresYUp{UpAxis::kY, AxesScope::kWorldAndBody, 1.0};
inline constexpr OutputAxes kMillimetres{UpAxis::kZ, AxesScope::kWorld, 1000.0};
inline constexpr OutputAxes kAutopilot{UpAxis::kDown, AxesScope::kWorldAndBody, 1.0};

inline constexpr std::array<ProtocolConventions, 8> kProtocolConventions{{
    {"vrpn",
     kMetres,
     "xyzw",
     WhenInvalid::kStop,
     "no reports",
     {95, "@", false, true},
     "UTC of the pose"},
    {"natnet",
     kMetresYUp,
     "xyzw",
     WhenInvalid::kFlag,
     "tracking-valid bit clear, mean error 0, last pose kept",
     {255, ",", false, true},
     "server seconds of the pose; exposure and transmit in ticks"},
    {"vicon",
     kMillimetres,
     "matrix",
     WhenInvalid::kFlag,
     "occluded",
     {127, "!\"#$%&'()*+,-./:;<=>?@[\\]^`{|}~", true, false},
     "frame number = time of the pose x rate; total latency counts back to that time"},
    {"qualisys",
     kMillimetres,
     "matrix",
     WhenInvalid::kFlag,
     "NaN",
     {255, "<>&\"'", false, true},
     "server microseconds of the pose"},
    {"ros2",
     kMetres,
     "xyzw",
     WhenInvalid::kStop,
     "no messages; diagnostics say why",
     {90, "-./~{}:\\", true, false},
     "UTC of the pose"},
    {"px4",
     kAutopilot,
     "wxyz",
     WhenInvalid::kStop,
     "no messages",
     {90, "-./~{}:\\", true, false},
     "UTC of the pose"},
    {"mavlink",
     kAutopilot,
     "wxyz",
     WhenInvalid::kStop,
     "no messages",
     {0, "", true, true},
     "server time of the pose; TIMESYNC ties it to the autopilot's"},
    {"native",
     kMetres,
     "wxyz",
     WhenInvalid::kFlag,
     "valid = false",
     {128, "", false, true},
     "server nanoseconds of the pose, with its offset to UTC"},
}};

[[nodiscard]] constexpr const ProtocolConventions& conventions_of(std::string_view protocol) {
  for (const auto& one : kProtocolConventions) {
    if (one.protocol == protocol) return one;
  }
  return kProtocolConventions.back();
}

struct PortUse {
  std::uint16_t number{};
  bool udp{};
};

/// One protocol of a configuration: where it listens and in which axes it speaks. The rest of its
/// conventions are in the table above.
struct ServedProtocol {
  std::string_view name;
  bool enabled{};
  std::string address;
  std::vector<PortUse> ports;  ///< 0: any free one.
  OutputAxes axes;
  WhenInvalid when_invalid{WhenInvalid::kFlag};
};

}  // namespace fiducap
