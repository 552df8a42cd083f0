#include "capture/import/message_log.hpp"

#include <algorithm>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include "base/bytes.hpp"
#include "base/text.hpp"
#include "capture/import/input_file.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {

std::string plain_type(const std::string& type) {
  constexpr std::string_view kMiddle = "/msg/";
  const std::size_t at = type.find(kMiddle);
  if (at == std::string::npos) return type;
  return type.substr(0, at) + "/" + type.substr(at + kMiddle.size());
}

std::string printable_name(std::string_view text) { return printable(text.substr(0, 200)); }

std::size_t MessageLog::index_of(LoggedTopic topic) {
  const auto known = std::ranges::find_if(topics_, [&](const LoggedTopic& one) {
    return one.name == topic.name && one.type == topic.type;
  });
  const auto index = static_cast<std::size_t>(known - topics_.begin());
  if (known == topics_.end()) topics_.push_back(std::move(topic));
  return index;
}

Expected<std::unique_ptr<MessageLog>> open_message_log(const std::string& path) {
  if (is_folder(path)) return open_rosbag2_folder(path);
  auto file = InputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  std::vector<std::byte> head;
  const bool read = file->read(std::min<std::uint64_t>(file->size(), 16), head);
  const std::string_view begin = read ? text_of_bytes(head) : "";
  if (begin.starts_with("#ROSBAG")) return open_bag(path);
  if (begin.starts_with("\x89MCAP")) return open_mcap(path);
  if (begin.starts_with("SQLite format 3")) return open_db3(path);
  return fail(ErrorCode::kUnsupported,
              "is neither a bag of ROS 1, nor MCAP, nor an SQLite file of rosbag2", path);
}

namespace {

/// Result of one call of a library.
struct UnpackStep {
  std::size_t taken{};
  std::size_t given{};
  bool ended{};
  bool failed{};
};

/// Runs `step(in, out)` until the content ends; `out` grows by factors of 1.5.
template <typename Step>
Expected<void> unpack_all(std::span<const std::byte> packed, std::uint64_t stated,
                          UnpackBudget& budget, std::vector<std::byte>& out, Step&& step) {
  const std::uint64_t most = stated > 0 ? stated : kLargestChunk_bytes;
  const std::uint64_t begun_with = budget.left();
  out.clear();
  std::size_t filled = 0;
  for (;;) {
    if (filled == out.size()) {
      // One byte more than stated, to detect a larger content.
      const std::uint64_t next = std::max<std::uint64_t>(65536, filled + filled / 2);
      const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(next, most + 1));
      out.reserve(size);  // no more: resize would double it
      out.resize(size);
    }
    const UnpackStep did = step(packed, std::span(out).subspan(filled));
    if (did.failed) return fail(ErrorCode::kInvalid, "cannot be unpacked: it is damaged");
    packed = packed.subspan(did.taken);
    filled += did.given;
    budget.spend(did.given);
    if (filled > begun_with)
      return fail(ErrorCode::kUnsupported, "was left out: the file unpacks to more than " +
                                               std::to_string(UnpackBudget::kPerByte) +
                                               " times its size");
    if (filled > most && stated == 0) return fail(ErrorCode::kUnsupported, kChunkTooLarge);
    if (filled > most)
      return fail(ErrorCode::kInvalid,
                  "unpacks to more than the stated " + std::to_string(most) + " bytes");
    if (did.ended) break;
    if (did.taken == 0 && did.given == 0 && filled < out.size())
      return fail(ErrorCode::kTruncated, "ends before its content does");
  }
  out.resize(filled);
  if (stated == 0 || filled == stated) return {};
  return fail(ErrorCode::kInvalid,
              "unpacks to " + std::to_string(filled) + " bytes, not to " + std::to_string(stated));
}

Expected<void> unpack_bz2(std::span<const std::byte> packed, std::uint64_t stated,
                          UnpackBudget& budget, std::vector<std::byte>& out) {
  struct End {
    void operator()(bz_stream* s) const { BZ2_bzDecompressEnd(s); }
  };
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK)
    return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  const std::unique_ptr<bz_stream, End> closes(&stream);
  return unpack_all(packed, stated, budget, out, [&](auto in, auto to) {
    stream.next_in = const_cast<char*>(reinterpret_cast<const char*>(in.data()));
    stream.avail_in = static_cast<unsigned>(in.size());
    stream.next_out = reinterpret_cast<char*>(to.data());
    stream.avail_out = static_cast<unsigned>(to.size());
    const int code = BZ2_bzDecompress(&stream);
    return UnpackStep{in.size() - stream.avail_in, to.size() - stream.avail_out,
                      code == BZ_STREAM_END, code != BZ_OK && code != BZ_STREAM_END};
  });
}

Expected<void> unpack_lz4(std::span<const std::byte> packed, std::uint64_t stated,
                          UnpackBudget& budget, std::vector<std::byte>& out) {
  struct End {
    void operator()(LZ4F_dctx* c) const { LZ4F_freeDecompressionContext(c); }
  };
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0)
    return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  const std::unique_ptr<LZ4F_dctx, End> context(made);
  return unpack_all(packed, stated, budget, out, [&](auto in, auto to) {
    std::size_t taken = in.size();
    std::size_t given = to.size();
    const std::size_t code =
        LZ4F_decompress(context.get(), to.data(), &given, in.data(), &taken, nullptr);
    return UnpackStep{taken, given, code == 0, LZ4F_isError(code) != 0};
  });
}

Expected<void> unpack_zstd(std::span<const std::byte> packed, std::uint64_t stated,
                           UnpackBudget& budget, std::vector<std::byte>& out) {
  struct End {
    void operator()(ZSTD_DStream* s) const { ZSTD_freeDStream(s); }
  };
  const std::unique_ptr<ZSTD_DStream, End> stream(ZSTD_createDStream());
  if (!stream) return fail(ErrorCode::kUnavailable, "there was no memory to unpack it");
  return unpack_all(packed, stated, budget, out, [&](auto in, auto to) {
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer into{to.data(), to.size(), 0};
    const std::size_t code = ZSTD_decompressStream(stream.get(), &into, &from);
    return UnpackStep{from.pos, into.pos, code == 0, ZSTD_isError(code) != 0};
  });
}

}  // namespace

Expected<void> unpack_chunk(std::string_view compression, std::span<const std::byte> packed,
                            std::uint64_t stated_bytes, UnpackBudget& budget,
                            std::vector<std::byte>& out) {
  if (stated_bytes > kLargestChunk_bytes || packed.size() > kLargestChunk_bytes)
    return fail(ErrorCode::kUnsupported, kChunkTooLarge);
  if (compression.empty() || compression == "none") {
    out.assign(packed.begin(), packed.end());
    return {};
  }
  // Some writers pack an empty content as nothing.
  if (packed.empty() && stated_bytes == 0) {
    out.clear();
    return {};
  }
  if (compression == "bz2") return unpack_bz2(packed, stated_bytes, budget, out);
  if (compression == "lz4") return unpack_lz4(packed, stated_bytes, budget, out);
  if (compression == "zstd") return unpack_zstd(packed, stated_bytes, budget, out);
  return fail(ErrorCode::kUnsupported, "is packed by '" + std::string(compression.substr(0, 16)) +
                                           "'; supported are none, bz2, lz4 and zstd");
}

}  // namespace fiducap
