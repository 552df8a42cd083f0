#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

namespace fiducap::vicon {

/// Packets of a client, byte by byte.
namespace client {

using Bytes = std::vector<std::byte>;

inline void u32(Bytes& out, std::uint32_t v) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::byte>(v >> (8 * i)));
}

inline Bytes words(std::initializer_list<std::uint32_t> values) {
  Bytes out;
  for (const auto value : values) u32(out, value);
  return out;
}

inline Bytes packet(std::uint32_t type, const Bytes& payload) {
  const auto size = static_cast<std::uint32_t>(payload.size());
  Bytes out = words({0x1A2B0001, 8 + size, type, size});
  out.insert(out.end(), payload.begin(), payload.end());
  return out;
}

inline Bytes types(const std::set<std::uint32_t>& wanted) {
  Bytes payload = words({static_cast<std::uint32_t>(wanted.size())});
  for (const auto type : wanted) u32(payload, type);
  return packet(100001, payload);
}
inline Bytes request_frame(bool streaming) {
  return packet(100002, {static_cast<std::byte>(streaming)});
}
inline Bytes request_next(std::uint32_t n) { return packet(100008, words({n})); }
inline Bytes ping(std::uint32_t id) { return packet(42, words({id, 0})); }
inline Bytes filter(const std::map<std::uint32_t, std::set<std::uint32_t>>& wanted) {
  Bytes payload = words({static_cast<std::uint32_t>(wanted.size())});
  for (const auto& [type, ids] : wanted) {
    u32(payload, type);
    u32(payload, static_cast<std::uint32_t>(ids.size()));
    for (const auto id : ids) u32(payload, id);
  }
  return packet(100007, payload);
}

/// As SDK 1.12 asks after EnableSegmentData and EnableDebugData, cut to what is offered.
inline const std::set<std::uint32_t> kSegments{1,  2,  5,  8,  9,  23,    26,
                                               28, 36, 37, 39, 40, 28001, 100004};
/// After EnableLightweightSegmentData.
inline const std::set<std::uint32_t> kLight{1, 2, 5, 23, 26, 28, 37, 39, 40, 901, 28001, 100004};

}  // namespace client
}  // namespace fiducap::vicon
