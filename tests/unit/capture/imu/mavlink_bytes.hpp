#pragma once

// Golden bytes, made by mavlink/c_library_v2, commit 7e16bc08f14a4f8bfab474de831013a6455ee3da.
// All numbers differ, so that no swapped order can pass.
namespace fiducap::mavlink::golden {

// --- system 3, PX4, MAVLink 2 --------------------------------------------------------------------
inline constexpr const char* kHeartbeatOfPx4 = "fd09000000030100000000000504020c510403581c";
/// At 123.456789 s: f = (0.5, −0.25, −9.75), w = (0.125, −0.0625, 0.03125).
inline constexpr const char* kHighres =
    "fd3e000002030169000015cd5b07000000000000003f000080be00001cc10000003e000080bd0000003d"
    "cdcccc3dcdcc4c3e9a99993e00507d440000003f0000f64200001242ff1f184c";
/// 5 ms later, with a new reading of the accelerometer only.
inline constexpr const char* kHighresWithoutGyro =
    "fd3d00000303016900009de05b07000000000000003f000080be00001cc10000003e000080bd0000003d"
    "cdcccc3dcdcc4c3e9a99993e00507d440000003f0000f642000012420725dc";
/// At 223.456789 s, signed.
inline constexpr const char* kHighresSigned =
    "fd3d010006030169000015ae510d000000000000003f000080be00001cc10000003e000080bd0000003d"
    "cdcccc3dcdcc4c3e9a99993e00507d440000003f0000f642000012423f46c802e8030000000022fa38c3410e";
/// Its clock is 7 s; our request was at 5 s.
inline constexpr const char* kTimesyncAnswer = "fd0d00000403016f000000863ba10100000000f2052a0104b5";
inline constexpr const char* kTimesyncQuestion =
    "fd0d00000503016f00000000000000000000c05a90a8010885";

// --- system 7, ArduPilot -------------------------------------------------------------------------
inline constexpr const char* kHeartbeatOfArduPilot = "fe0909070100050000000203510403a1cd";
/// MAVLink 1, at 98.765432 s: f = (10, −20, −1000) mg, w = (0.1, −0.2, 0.3).
inline constexpr const char* kRaw =
    "fe1a0707011b780ae305000000000a00ecff18fc640038ff2c01010002000300b3d9";
/// MAVLink 1, at 4000.123 s: f = (12, −22, −1002) mg, w = (0.102, −0.202, 0.302).
inline constexpr const char* kScaled =
    "fe160807011a7b093d000c00eaff16fc660036ff2e010100020003000575";
/// f = (10, −20, −1000) mg, w = (0.1, −0.2, 0.3); with a temperature.
inline constexpr const char* kScaled2 =
    "fd1800000907017400007b093d000a00ecff18fc640038ff2c01010002000300c409b72e";
/// f = (11, −21, −1001) mg, w = (0.101, −0.201, 0.301).
inline constexpr const char* kScaled3 =
    "fd1500000a07018100007b093d000b00ebff17fc650037ff2d01010002000309ae";
/// An unknown message.
inline constexpr const char* kAttitude =
    "fe1c0a07011e7b093d000000803f0000004000004040000080400000a0400000c0409fde";

// --- ours, to system 3, component 1 --------------------------------------------------------------
/// SET_MESSAGE_INTERVAL of HIGHRES_IMU to 5000 µs.
inline constexpr const char* kAskForHighres =
    "fd2000000403bf4c00000000d24200409c450000000000000000000000000000000000000000ff010301db45";
inline constexpr const char* kAskForStream = "fd0600000503bf420000320003010101709d";

}  // namespace fiducap::mavlink::golden
