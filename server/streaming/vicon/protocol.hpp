#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

/// The numbers of the Vicon DataStream ("CGStream").
namespace fiducap::vicon {

inline constexpr std::uint32_t kPacketTag = 0x1A2B0001;
inline constexpr std::size_t kHeaderSize = 8;              ///< Of a packet and of an object alike: u32, u32 length.
inline constexpr std::size_t kMaxClientPacket = 64 * 1024; ///< Real clients send some hundred bytes.
inline constexpr std::uint32_t kTicksPerSecond = 135'000'000;
inline constexpr std::uint32_t kRootParent = 0;
inline constexpr std::uint32_t kSegment = 1;               ///< Each subject's only one. 0 would be its own parent.

/// What an object is.
enum class Type : std::uint32_t {
  kStreamInfo = 1,
  kSubjectInfo = 2,
  kFrameInfo = 5,
  kLocalSegments = 8,
  kGlobalSegments = 9,
  kTimecode = 23,
  kLatencyInfo = 26,
  kSubjectTopology = 28,
  kHardwareFrameInfo = 36,
  kApplicationInfo = 37,
  kFrameRateInfo = 39,
  kObjectQuality = 40,
  kPing = 42,
  kLightweightSegments = 901,
  kSubjectScale = 28001,
  kObjectEnums = 100001,
  kRequestFrame = 100002,
  kContents = 100004,
  kStartMulticastSender = 100005,
  kStopMulticastSender = 100006,
  kFilter = 100007,
  kRequestNextFrame = 100008,
};

/// What this server can send, ascending: its greeting.
inline constexpr std::array<Type, 16> kOffered{
    Type::kStreamInfo,      Type::kSubjectInfo,     Type::kFrameInfo,    Type::kLocalSegments,
    Type::kGlobalSegments,  Type::kTimecode,        Type::kLatencyInfo,  Type::kSubjectTopology,
    Type::kHardwareFrameInfo, Type::kApplicationInfo, Type::kFrameRateInfo, Type::kObjectQuality,
    Type::kPing,            Type::kLightweightSegments, Type::kSubjectScale, Type::kContents};

/// Sent when they change; in all other frames a client is told that they did not.
[[nodiscard]] constexpr bool is_static(Type type) {
  return type == Type::kStreamInfo || type == Type::kSubjectInfo || type == Type::kSubjectTopology ||
         type == Type::kApplicationInfo || type == Type::kSubjectScale;
}

/// Clients keep these from frame to frame unless a newer one comes: the static ones, and the quality, which we renew.
[[nodiscard]] constexpr bool is_kept_by_clients(Type type) {
  return is_static(type) || type == Type::kObjectQuality;
}

/// One object per subject, so that a filter can name subjects.
[[nodiscard]] constexpr bool is_per_subject(Type type) {
  return type == Type::kSubjectInfo || type == Type::kLocalSegments || type == Type::kGlobalSegments ||
         type == Type::kSubjectTopology || type == Type::kObjectQuality || type == Type::kLightweightSegments ||
         type == Type::kSubjectScale;
}

}  // namespace fiducap::vicon
