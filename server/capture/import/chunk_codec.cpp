#include "capture/import/chunk_codec.hpp"

#include <algorithm>
#include <memory>
#include <string>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

namespace fiducap {
namespace {

/// What one call of a library did.
struct UnpackStep {
  std::size_t taken{};
  std::size_t given{};
  bool ended{};
  bool failed{};
};

/// Runs `step(in, out)` until the content ends; `out` grows by halves of what is there.
template <typename Step>
Expected<void> unpack_all(std::span<const std::byte> packed, std::uint64_t said,
                          std::vector<std::byte>& out, Step&& step) {
  const std::uint64_t most = said > 0 ? said : kLargestChunk_bytes;
  out.clear();
  std::size_t filled = 0;
  for (;;) {
    if (filled == out.size()) {
      if (filled >= most && said == 0)
        return fail(ErrorCode::kUnsupported, "unpacks to more than 512 MiB");
      // One byte more than said shows that there is more than said.
      const std::uint64_t next = std::max<std::uint64_t>(65536, filled + filled / 2);
      out.resize(static_cast<std::size_t>(std::min<std::uint64_t>(next, most + 1)));
    }
    const UnpackStep did = step(packed, std::span(out).subspan(filled));
    if (did.failed) return fail(ErrorCode::kInvalid, "cannot be unpacked: its bytes are damaged");
    packed = packed.subspan(did.taken);
    filled += did.given;
    if (filled > most)
      return fail(ErrorCode::kInvalid,
                  "unpacks to more than the " + std::to_string(most) + " bytes it should have");
    if (did.ended) break;
    if (did.taken == 0 && did.given == 0 && filled < out.size())
      return fail(ErrorCode::kTruncated, "ends before its content does");
  }
  out.resize(filled);
  if (said == 0 || filled == said) return {};
  return fail(ErrorCode::kInvalid,
              "unpacks to " + std::to_string(filled) + " bytes, not to " + std::to_string(said));
}

Expected<void> unpack_bz2(std::span<const std::byte> packed, std::uint64_t said,
                          std::vector<std::byte>& out) {
  struct End {
    void operator()(bz_stream* s) const { BZ2_bzDecompressEnd(s); }
  };
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK)
    return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  const std::unique_ptr<bz_stream, End> closes(&stream);
  return unpack_all(packed, said, out, [&](auto in, auto to) {
    // The library only reads; its pointer knows no const.
    stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(in.data()));
    stream.avail_in = static_cast<unsigned>(in.size());
    stream.next_out = reinterpret_cast<char*>(to.data());
    stream.avail_out = static_cast<unsigned>(to.size());
    const int code = BZ2_bzDecompress(&stream);
    return UnpackStep{in.size() - stream.avail_in, to.size() - stream.avail_out,
                      code == BZ_STREAM_END, code != BZ_OK && code != BZ_STREAM_END};
  });
}

Expected<void> unpack_lz4(std::span<const std::byte> packed, std::uint64_t said,
                          std::vector<std::byte>& out) {
  struct End {
    void operator()(LZ4F_dctx* c) const { LZ4F_freeDecompressionContext(c); }
  };
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0)
    return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  const std::unique_ptr<LZ4F_dctx, End> context(made);
  return unpack_all(packed, said, out, [&](auto in, auto to) {
    std::size_t taken = in.size();
    std::size_t given = to.size();
    const std::size_t code =
        LZ4F_decompress(context.get(), to.data(), &given, in.data(), &taken, nullptr);
    return UnpackStep{taken, given, code == 0, LZ4F_isError(code) != 0};
  });
}

Expected<void> unpack_zstd(std::span<const std::byte> packed, std::uint64_t said,
                           std::vector<std::byte>& out) {
  struct End {
    void operator()(ZSTD_DStream* s) const { ZSTD_freeDStream(s); }
  };
  const std::unique_ptr<ZSTD_DStream, End> stream(ZSTD_createDStream());
  if (!stream) return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  return unpack_all(packed, said, out, [&](auto in, auto to) {
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer into{to.data(), to.size(), 0};
    const std::size_t code = ZSTD_decompressStream(stream.get(), &into, &from);
    return UnpackStep{from.pos, into.pos, code == 0, ZSTD_isError(code) != 0};
  });
}

}  // namespace

Expected<void> unpack_chunk(std::string_view compression, std::span<const std::byte> packed,
                            std::uint64_t said_bytes, std::vector<std::byte>& out) {
  if (said_bytes > kLargestChunk_bytes || packed.size() > kLargestChunk_bytes)
    return fail(ErrorCode::kUnsupported, "is larger than 512 MiB");
  if (compression.empty() || compression == "none") {
    out.assign(packed.begin(), packed.end());
    return {};
  }
  // Nothing at all is packed as nothing by some writers.
  if (packed.empty() && said_bytes == 0) {
    out.clear();
    return {};
  }
  if (compression == "bz2") return unpack_bz2(packed, said_bytes, out);
  if (compression == "lz4") return unpack_lz4(packed, said_bytes, out);
  if (compression == "zstd") return unpack_zstd(packed, said_bytes, out);
  return fail(ErrorCode::kUnsupported, "is packed by '" + std::string(compression.substr(0, 16)) +
                                           "'; known are none, bz2, lz4 and zstd");
}

}  // namespace fiducap
