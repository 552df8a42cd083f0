#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// The numbers and names of VRPN 07.xx.
namespace fiducap::vrpn {

inline constexpr std::size_t kCookieSize = 24;
inline constexpr std::size_t kHeaderSize = 24;
inline constexpr std::size_t kSequenceOffset = 20;  ///< Of the sequence number inside a header.
inline constexpr std::size_t kMaxPayload = 64000;  ///< What libvrpn takes by TCP, and what we take.
inline constexpr std::size_t kMaxDatagram =
    1472;  ///< A longer one makes the client drop the connection.
inline constexpr std::size_t kMaxNameBytes = 95;  ///< 96 do not work with libvrpn.
inline constexpr std::size_t kMaxTextBytes = 1023;
inline constexpr int kMaxIds = 2000;                ///< Sender ids are 0..1999.
inline constexpr std::uint16_t kLowestPort = 1024;  ///< Never connect or send to a port below.
inline constexpr std::string_view kControlName = "VRPN Control";  ///< Sender 0; discovery skips it.

/// System messages.
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

}  // namespace fiducap::vrpn
