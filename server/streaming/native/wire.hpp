#pragma once

#include <cstddef>
#include <cstdint>

namespace fiducap::native {

/// First field of every datagram, see `proto/fiducap/v1/envelope.proto`: "FDC1".
inline constexpr std::uint32_t kProtocol = 0x31434446;
/// Fits every path between two hosts without fragments (IPv6 minimum MTU 1280 minus headers).
inline constexpr std::size_t kMaxDatagram = 1200;
/// A shorter Subscribe is ignored: the answer to an address that is not proven must not be longer
/// than the question.
inline constexpr std::size_t kMinSubscribe = 128;
inline constexpr std::size_t kMinClockQuery = 64;
inline constexpr std::size_t kMinDiscovery = 256;
inline constexpr std::size_t kMaxBodies = 1024;
inline constexpr std::size_t kMaxParts = 256;
inline constexpr std::size_t kMaxBodyName = 128;
inline constexpr std::size_t kMaxClientName = 64;
inline constexpr int kMaxChosenBodies = 32;
inline constexpr std::size_t kMaxHostName = 64;
inline constexpr std::size_t kMaxVersion = 32;

}  // namespace fiducap::native
