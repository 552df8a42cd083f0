#pragma once

#include <cstddef>
#include <cstdint>

/// Numbers of MAVLink that travel on the wire (common.xml). Version 2 is written; 1 and 2 are read.
namespace fiducap::mavlink {

enum class MessageId : std::uint32_t {
  kHeartbeat = 0,
  kScaledImu = 26,
  kRawImu = 27,
  kRequestDataStream = 66,
  kCommandLong = 76,
  kCommandAck = 77,
  kVisionPositionEstimate = 102,
  kHighresImu = 105,
  kTimesync = 111,
  kScaledImu2 = 116,
  kScaledImu3 = 129,
  kOdometry = 331,
};

inline constexpr std::uint8_t kMagic1 = 0xfe;
inline constexpr std::uint8_t kMagic2 = 0xfd;
inline constexpr std::size_t kHeader1 = 6;
inline constexpr std::size_t kHeader2 = 10;
inline constexpr std::size_t kChecksum = 2;
inline constexpr std::size_t kSignature = 13;
inline constexpr std::size_t kMaxPayload = 255;
inline constexpr std::size_t kMaxFrame = kHeader2 + kMaxPayload + kChecksum + kSignature;
inline constexpr std::uint8_t kSigned = 0x01;  ///< Of the incompatibility flags.

inline constexpr std::uint8_t kOnboardController = 18;  ///< MAV_TYPE
inline constexpr std::uint8_t kNoAutopilot = 8;         ///< MAV_AUTOPILOT_INVALID
inline constexpr std::uint8_t kArduPilot = 3;           ///< MAV_AUTOPILOT
inline constexpr std::uint8_t kPx4 = 12;
inline constexpr std::uint8_t kStateStandby = 3;  ///< MAV_STATE
inline constexpr std::uint8_t kStateActive = 4;
inline constexpr std::uint8_t kProtocolVersion = 3;
inline constexpr std::uint8_t kFrameLocalNed = 1;  ///< MAV_FRAME
inline constexpr std::uint8_t kFrameBodyFrd = 12;
inline constexpr std::uint8_t kFrameLocalFrd = 20;
inline constexpr std::uint8_t kEstimatorMocap = 6;     ///< MAV_ESTIMATOR_TYPE
inline constexpr std::uint8_t kOnboardComputer = 191;  ///< MAV_COMP_ID
inline constexpr std::uint8_t kVisualInertialOdometry = 197;
inline constexpr std::uint16_t kSetMessageInterval = 511;  ///< MAV_CMD
inline constexpr std::uint8_t kRawSensors = 1;             ///< MAV_DATA_STREAM
inline constexpr std::uint8_t kAccepted = 0;               ///< MAV_RESULT

}  // namespace fiducap::mavlink
