#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string_view>

/// The numbers and names of the QTM real-time protocol, 1.0 to 1.28.
namespace fiducap::qualisys {

inline constexpr std::size_t kHeaderSize = 8;          ///< u32 size of the whole packet, u32 type.
inline constexpr std::size_t kMaxIncoming = 64 << 10;  ///< Settings are the longest packets.
/// Of UDP.
inline constexpr std::size_t kMaxDatagram = 65'507;
inline constexpr std::uint16_t kLowestUdpPort = 1024;
inline constexpr std::size_t kDiscoverSize = 10;

/// Offsets of the ports from the base port.
inline constexpr std::uint16_t kLegacyOffset = 0;        ///< Version 1.0 only, big-endian.
inline constexpr std::uint16_t kLittleEndianOffset = 1;  ///< What every current client uses.
inline constexpr std::uint16_t kBigEndianOffset = 2;

enum class PacketType : std::uint32_t {
  kError = 0,
  kCommand = 1,
  kXml = 2,
  kData = 3,
  kNoMoreData = 4,
  kEvent = 6,
  kDiscover = 7,
};

enum class Event : std::uint8_t {
  kConnected = 1,
  kConnectionClosed = 2,
  kCaptureStarted = 3,
  kCaptureStopped = 4,
  kCameraSettingsChanged = 11,  ///< Here: the list of bodies changed.
  kShuttingDown = 12,
  kCaptureSaved = 13,
};

/// Minor number of protocol 1.N.
struct Version {
  int minor{1};  ///< Default.

  static constexpr int kNewest = 28;
  /// Before 1.8 coordinates are doubles.
  [[nodiscard]] constexpr bool wide() const { return minor < 8; }
  /// Until 1.20 bodies are described differently.
  [[nodiscard]] constexpr bool old_parameters() const { return minor < 21; }
};

/// Component types of data packets, as on the wire.
enum class Component : std::uint32_t {
  k3d = 1,
  k3dNoLabels = 2,
  kAnalog = 3,
  kForce = 4,
  k6d = 5,
  k6dEuler = 6,
  k2d = 7,
  k2dLin = 8,
  k3dRes = 9,
  k3dNoLabelsRes = 10,
  k6dRes = 11,
  k6dEulerRes = 12,
  kAnalogSingle = 13,
  kImage = 14,
  kForceSingle = 15,
  kGazeVector = 16,
  kTimecode = 17,
  kSkeleton = 18,
  kEyeTracker = 19,
};

struct ComponentWord {
  std::string_view word;  ///< As clients send it; case does not matter.
  Component component;
};

/// In ascending order of their types.
inline constexpr std::array<ComponentWord, 19> kComponentWords{{
    {"3D", Component::k3d},
    {"3DNoLabels", Component::k3dNoLabels},
    {"Analog", Component::kAnalog},
    {"Force", Component::kForce},
    {"6D", Component::k6d},
    {"6DEuler", Component::k6dEuler},
    {"2D", Component::k2d},
    {"2DLin", Component::k2dLin},
    {"3DRes", Component::k3dRes},
    {"3DNoLabelsRes", Component::k3dNoLabelsRes},
    {"6DRes", Component::k6dRes},
    {"6DEulerRes", Component::k6dEulerRes},
    {"AnalogSingle", Component::kAnalogSingle},
    {"Image", Component::kImage},
    {"ForceSingle", Component::kForceSingle},
    {"GazeVector", Component::kGazeVector},
    {"Timecode", Component::kTimecode},
    {"Skeleton", Component::kSkeleton},
    {"EyeTracker", Component::kEyeTracker},
}};

/// A set of components; they are sent in ascending order of their types.
class Components final {
 public:
  constexpr Components() = default;
  constexpr Components(std::initializer_list<Component> all) {
    for (const Component c : all) add(c);
  }
  constexpr void add(Component c) { bits_ |= bit(c); }
  [[nodiscard]] constexpr bool has(Component c) const { return (bits_ & bit(c)) != 0; }
  [[nodiscard]] constexpr bool empty() const { return bits_ == 0; }

  /// Those with bodies: the meaning of `All` here.
  [[nodiscard]] static constexpr Components all() {
    return {Component::k6d, Component::k6dEuler, Component::k6dRes, Component::k6dEulerRes};
  }
  friend constexpr bool operator==(const Components&, const Components&) = default;

 private:
  [[nodiscard]] static constexpr std::uint32_t bit(Component c) {
    return 1U << static_cast<std::uint32_t>(c);
  }
  std::uint32_t bits_{0};
};

}  // namespace fiducap::qualisys
