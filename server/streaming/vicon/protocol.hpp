#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

/// The numbers of the Vicon DataStream ("CGStream"), and what a client selects of it.
namespace fiducap::vicon {

inline constexpr std::uint32_t kPacketTag = 0x1A2B0001;
inline constexpr std::size_t kHeaderSize = 8;  ///< Of packets and objects: u32, u32 length.
inline constexpr std::size_t kMaxClientPacket = 64 * 1024;  ///< Clients send some hundred bytes.
inline constexpr std::uint32_t kTicksPerSecond = 135'000'000;
inline constexpr std::uint32_t kRootParent = 0;
inline constexpr std::uint32_t kSegment = 1;  ///< The only one of a subject; 0 would be its parent.

/// Type of an object.
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

/// Types that this server sends, ascending: its greeting.
inline constexpr std::array<Type, 16> kOffered{
    Type::kStreamInfo,
    Type::kSubjectInfo,
    Type::kFrameInfo,
    Type::kLocalSegments,
    Type::kGlobalSegments,
    Type::kTimecode,
    Type::kLatencyInfo,
    Type::kSubjectTopology,
    Type::kHardwareFrameInfo,
    Type::kApplicationInfo,
    Type::kFrameRateInfo,
    Type::kObjectQuality,
    Type::kPing,
    Type::kLightweightSegments,
    Type::kSubjectScale,
    Type::kContents,
};

/// Sent when they change; in other frames marked as unchanged.
[[nodiscard]] constexpr bool is_static(Type type) {
  return type == Type::kStreamInfo || type == Type::kSubjectInfo ||
         type == Type::kSubjectTopology || type == Type::kApplicationInfo ||
         type == Type::kSubjectScale;
}

/// Clients keep these until a newer one comes: the static ones, and the quality.
[[nodiscard]] constexpr bool is_kept_by_clients(Type type) {
  return is_static(type) || type == Type::kObjectQuality;
}

/// One object per subject, so that a filter can name subjects.
[[nodiscard]] constexpr bool is_per_subject(Type type) {
  return type == Type::kSubjectInfo || type == Type::kLocalSegments ||
         type == Type::kGlobalSegments || type == Type::kSubjectTopology ||
         type == Type::kObjectQuality || type == Type::kLightweightSegments ||
         type == Type::kSubjectScale;
}

/// Place in kOffered; nullopt for a type that is not sent.
[[nodiscard]] constexpr std::optional<std::size_t> index_of(std::uint32_t type) {
  for (std::size_t i = 0; i < kOffered.size(); ++i)
    if (static_cast<std::uint32_t>(kOffered[i]) == type) return i;
  return std::nullopt;
}

/// Some of the offered types.
class TypeSet final {
 public:
  constexpr TypeSet() = default;

  /// Ignores a type that is not offered.
  constexpr void add(std::uint32_t type) {
    if (const auto i = index_of(type)) bits_ |= 1u << *i;
  }
  [[nodiscard]] constexpr bool has(Type type) const {
    const auto i = index_of(static_cast<std::uint32_t>(type));
    return i && (bits_ >> *i & 1u) != 0;
  }
  [[nodiscard]] constexpr std::size_t size() const {
    std::size_t n = 0;
    for (std::uint32_t left = bits_; left != 0; left &= left - 1) ++n;
    return n;
  }
  [[nodiscard]] static constexpr TypeSet all() {
    TypeSet set;
    for (const Type type : kOffered) set.add(static_cast<std::uint32_t>(type));
    return set;
  }

  friend constexpr bool operator==(TypeSet, TypeSet) = default;
  friend constexpr TypeSet operator|(TypeSet a, TypeSet b) {
    a.bits_ |= b.bits_;
    return a;
  }

 private:
  std::uint32_t bits_{0};  ///< Bit i: kOffered[i].
};

/// Subjects that a client wants, by type. A type without an entry is unrestricted. Keys are offered
/// per-subject types; ids ascend, each once.
using SubjectFilter = std::map<Type, std::vector<std::uint32_t>>;

/// Clients with equal profiles get the same bytes.
struct Profile {
  TypeSet types;
  SubjectFilter filter;

  friend bool operator==(const Profile&, const Profile&) = default;
};

/// Makes equal profiles one object, so that they are compared by pointer: filters may be long.
class ProfileTable final {
 public:
  [[nodiscard]] std::shared_ptr<const Profile> share(Profile profile) {
    std::erase_if(profiles_, [](const auto& one) { return one.expired(); });
    for (const auto& one : profiles_)
      if (auto known = one.lock(); *known == profile) return known;
    auto added = std::make_shared<const Profile>(std::move(profile));
    profiles_.push_back(added);
    return added;
  }

 private:
  std::vector<std::weak_ptr<const Profile>> profiles_;
};

}  // namespace fiducap::vicon
