#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "fiducap/client.hpp"

/// Messages inside the client; see `proto/fiducap/v1/`.
namespace fiducap::sdk {

inline constexpr std::size_t kMaxDatagram = 1200;
inline constexpr std::size_t kMinSubscribe = 128;
inline constexpr std::size_t kMinDiscovery = 256;
inline constexpr std::size_t kMaxClientName = 64;
inline constexpr std::size_t kMaxBodyName = 128;
inline constexpr std::size_t kMaxChosenBodies = 32;
inline constexpr std::uint32_t kMaxBodies = 1024;
inline constexpr std::uint32_t kMaxParts = 256;

/// Nanoseconds on CLOCK_MONOTONIC.
using Nanoseconds = std::int64_t;
inline constexpr Nanoseconds kMillisecond = 1'000'000;
inline constexpr Nanoseconds kSecond = 1'000'000'000;

/// Selection of one client; the default is everything.
struct Profile {
  bool y_up{};
  bool turn_bodies{};   ///< The bodies' axes are rotated with the world's.
  float max_rate_hz{};  ///< 0: every frame.
  bool without_covariance{};
  std::vector<std::string> bodies;  ///< Empty: all.

  bool is_default() const {
    return !y_up && !turn_bodies && max_rate_hz == 0 && !without_covariance && bodies.empty();
  }
};

struct SubscribeRequest {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t model_generation{};
  std::string client_name;
  std::uint64_t frames_received{};
  std::uint64_t frames_lost{};
  Profile profile;
  bool multicast{};
  Nanoseconds clock_offset{};
  Nanoseconds clock_sigma{};  ///< 0: not measured.
  Nanoseconds latency_p99{};  ///< 0: unknown.
};

struct Challenge {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t session{};
};

struct Lease {
  std::uint64_t session{};
  std::uint64_t nonce{};
  std::uint64_t token{};
  Nanoseconds lease{};
  std::uint64_t model_generation{};
  std::uint32_t profile{};
  std::array<std::uint8_t, 4> group{};  ///< IPv4 multicast group of the frames.
  std::uint16_t group_port{};           ///< 0: unicast.
  std::uint64_t frames_dropped{};
};

struct Notice {
  std::uint64_t session{};
  std::uint64_t nonce{};
  bool shutting_down{};
  std::string text;
};

struct ClockReply {
  std::uint64_t session{};
  std::uint64_t number{};
  Nanoseconds received{};  ///< Server's clock.
  Nanoseconds answered{};
};

struct DiscoveryReply {
  std::uint64_t nonce{};
  std::uint64_t session{};
  std::string host;
  std::string version;
  int body_count{};
  double rate_hz{};
  std::uint16_t port{};
};

/// Position of a part in a list. Decoded parts satisfy: index < count <= kMaxParts,
/// first_body + bodies in this part <= body_count <= kMaxBodies.
struct PartPlace {
  std::uint32_t index{};
  std::uint32_t count{};
  std::uint32_t first_body{};
  std::uint32_t body_count{};
};

struct ModelPart {
  std::uint64_t session{};
  std::uint64_t generation{};
  std::uint32_t profile{};
  PartPlace place;
  std::vector<std::pair<int, std::string>> bodies;  ///< Id and name.
};

struct FramePart {
  std::uint64_t session{};
  std::uint64_t model_generation{};
  std::uint32_t profile{};
  std::uint64_t step{1};  ///< Numbers are multiples of it.
  PartPlace place;
  Frame frame;  ///< Header and the bodies of this part; names are empty, `received_ns` is 0.
};

}  // namespace fiducap::sdk
