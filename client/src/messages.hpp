#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "fiducap/client.hpp"

/// The inside of the client. Meaning of the messages: `proto/fiducap/v1/`.
namespace fiducap::sdk {

inline constexpr std::size_t kMaxDatagram = 1200;
inline constexpr std::size_t kMinSubscribe = 128;
inline constexpr std::size_t kMaxClientName = 64;
inline constexpr std::uint32_t kMaxBodies = 1024;
inline constexpr std::uint32_t kMaxParts = 256;

/// Nanoseconds on CLOCK_MONOTONIC.
using Nanoseconds = std::int64_t;
inline constexpr Nanoseconds kMillisecond = 1'000'000;
inline constexpr Nanoseconds kSecond = 1'000'000'000;

struct SubscribeRequest {
  std::uint64_t token{};
  std::uint64_t nonce{};
  std::uint64_t model_generation{};
  std::string client_name;
  std::uint64_t frames_received{};
  std::uint64_t frames_lost{};
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
};

struct Notice {
  std::uint64_t session{};
  std::uint64_t nonce{};
  bool shutting_down{};
  std::string text;
};

/// Where a part of a list belongs. Decoded parts satisfy: index < count <= kMaxParts,
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
  PartPlace place;
  std::vector<std::pair<int, std::string>> bodies;  ///< Id and name.
};

struct FramePart {
  std::uint64_t session{};
  std::uint64_t model_generation{};
  PartPlace place;
  Frame frame;  ///< Header and the bodies of this part; names are empty, `received_ns` is 0.
};

}  // namespace fiducap::sdk
