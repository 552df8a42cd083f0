#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "base/expected.hpp"

namespace fiducap {

/// Largest chunk or message that is unpacked.
inline constexpr std::uint64_t kLargestChunk_bytes = std::uint64_t{1} << 29;

/// Unpacks what a bag or MCAP file packed: `none` (or empty), `bz2`, `lz4` (frames, as ROS and MCAP
/// write them), `zstd`.
/// Memory grows with what really comes out, at most to what was said.
/// @param said_bytes  size of the content as the file says; 0: not known
/// @return Error when it is broken, larger than said, or its size is another one
[[nodiscard]] Expected<void> unpack_chunk(std::string_view compression,
                                          std::span<const std::byte> packed,
                                          std::uint64_t said_bytes, std::vector<std::byte>& out);

}  // namespace fiducap
