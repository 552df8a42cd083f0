#include "capture/import/message_log.hpp"

#include <map>

#include <zlib.h>

#include "base/bytes.hpp"
#include "capture/import/input_file.hpp"
#include "capture/import/record_log.hpp"

namespace fiducap {
namespace {

constexpr std::string_view kMcapMagic = "\x89MCAP0\r\n";
constexpr std::uint64_t kPiece_bytes = 1 << 20;

enum McapOp : std::uint8_t {
  kMcapNone = 0x00,  ///< In no file.
  kMcapFooter = 0x02,
  kMcapSchema = 0x03,
  kMcapChannel = 0x04,
  kMcapMessage = 0x05,
  kMcapChunk = 0x06,
  kMcapDataEnd = 0x0f
};

std::uint32_t crc_of(std::span<const std::byte> bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string mcap_text(LittleEndianReader& from) {
  return std::string(text_of_bytes(from.bytes(from.u32())));
}

struct McapRecord {
  std::uint8_t op{};
  std::span<const std::byte> content;
};

class McapLog final : public RecordLog {
 public:
  explicit McapLog(InputFile file) : RecordLog(std::move(file)) {}

  Expected<void> begin() {
    if (!file_.read(kMcapMagic.size(), head_) || text_of_bytes(head_) != kMcapMagic)
      return fail(ErrorCode::kInvalid, "is no MCAP file", file_.path());
    crc_ = crc_of(head_);
    return {};
  }

  Expected<bool> next(LoggedMessage& out) override {
    McapRecord record;
    for (;;) {
      const bool is_in_chunk = read_in_chunk(record);
      if (!is_in_chunk && !read_record(record)) return false;
      if (is_in_chunk && record.op == kMcapChunk) {
        drop_chunk("a chunk contains a chunk");
        continue;
      }
      if (data_ended_ && record.op != kMcapFooter) continue;  // the summary repeats data
      if (record.op == kMcapSchema) add_schema(record.content);
      if (record.op == kMcapChannel) add_channel(record.content);
      if (record.op == kMcapChunk) open_chunk(record.content);
      if (record.op == kMcapMessage && take(record.content, out)) return true;
      if (record.op == kMcapDataEnd) end_of_data(record.content);
      if (record.op == kMcapFooter) check_summary(record.content);
    }
  }

  std::vector<std::string> remarks() const override {
    std::vector<std::string> all;
    LogDamage damage = damage_;
    if (damage.cut_at == file_.size()) {  // between two records: only the end is missing
      all.emplace_back("was not closed (its recorder was killed): it was read from its start");
      damage.cut_at.reset();
    }
    damage.append_to(all, file_.size());
    return all;
  }

 private:
  /// Of the file. @return false at the end of the complete part
  bool read_record(McapRecord& record) {
    if (ended_ || damage_.cut_at) return false;
    damage_.cut_at = file_.at();  // until it is complete
    if (!file_.read(9, head_)) return false;
    LittleEndianReader from(head_);
    record.op = from.u8();
    const std::uint64_t length = from.u64();
    crc_before_ = crc_;
    crc_ = crc_of(head_, crc_);
    record.content = {};
    const bool wanted = record.op == kMcapFooter || record.op == kMcapDataEnd ||
                        (!data_ended_ && (record.op == kMcapSchema || record.op == kMcapChannel ||
                                          record.op == kMcapMessage || record.op == kMcapChunk));
    if (length > file_.left()) return false;
    if (!wanted || length > kLargestChunk_bytes) {
      if (!pass(length)) return false;
      if (wanted) damage_.note(std::string("a record ") + kChunkTooLarge);
      if (wanted) record.op = kMcapNone;
    } else {
      if (!file_.read(length, content_)) return false;
      crc_ = crc_of(content_, crc_);
      record.content = content_;
    }
    damage_.cut_at.reset();
    return true;
  }

  /// Skips bytes, including them in the checksum.
  bool pass(std::uint64_t bytes) {
    while (bytes > 0) {
      const std::uint64_t piece = std::min(bytes, kPiece_bytes);
      if (!file_.read(piece, content_)) return false;
      crc_ = crc_of(content_, crc_);
      bytes -= piece;
    }
    return true;
  }

  bool read_in_chunk(McapRecord& record) {
    if (chunk_at_ >= chunk_.size()) return false;
    LittleEndianReader from(std::span<const std::byte>(chunk_).subspan(chunk_at_));
    record.op = from.u8();
    const std::uint64_t length = from.u64();
    record.content = length <= from.left() ? from.bytes(static_cast<std::size_t>(length))
                                           : std::span<const std::byte>();
    if (from.failed() || record.op == kMcapNone || record.content.size() != length) {
      drop_chunk("a record in a chunk is broken");
      return false;
    }
    chunk_at_ = chunk_.size() - from.left();
    return true;
  }

  void open_chunk(std::span<const std::byte> content) {
    LittleEndianReader from(content);
    from.u64();  // first and last time
    from.u64();
    const std::uint64_t size = from.u64();
    const std::uint32_t crc = from.u32();
    const std::string compression = mcap_text(from);
    const std::uint64_t length = from.u64();
    if (from.failed() || length > from.left()) return damage_.note("a chunk has a broken head");
    const auto packed = from.bytes(static_cast<std::size_t>(length));
    if (unpack(compression, packed, size) && crc != 0 && crc != crc_of(chunk_))
      drop_chunk("a chunk has a wrong checksum");
  }

  void add_schema(std::span<const std::byte> content) {
    LittleEndianReader from(content);
    const std::uint16_t id = from.u16();
    std::string name = mcap_text(from);
    if (from.failed()) return damage_.note("a schema is broken");
    schemas_.emplace(id, plain_type(name));
  }

  void add_channel(std::span<const std::byte> content) {
    LittleEndianReader from(content);
    const std::uint16_t id = from.u16();
    const std::uint16_t schema = from.u16();
    const std::string name = mcap_text(from);
    const std::string encoding = mcap_text(from);
    if (from.failed()) return damage_.note("a channel is broken");
    if (channels_.contains(id) || channels_.size() == kMostTopics) return;  // also when repeated
    const auto type = schemas_.find(schema);
    const MessageFormat format = encoding == "cdr"    ? MessageFormat::kCdr
                                 : encoding == "ros1" ? MessageFormat::kRos1
                                                      : MessageFormat::kOther;
    channels_[id] = index_of({name, type == schemas_.end() ? encoding : type->second, format});
  }

  bool take(std::span<const std::byte> content, LoggedMessage& out) {
    LittleEndianReader from(content);
    const auto channel = channels_.find(from.u16());
    from.u32();  // sequence
    const std::uint64_t logged_ns = from.u64();
    from.u64();  // published
    if (from.failed() || channel == channels_.end()) {
      damage_.note("a message belongs to no channel");
      return false;
    }
    out = {channel->second, static_cast<std::int64_t>(logged_ns), from.bytes(from.left())};
    return true;
  }

  void end_of_data(std::span<const std::byte> content) {
    data_ended_ = true;
    const std::uint32_t crc = LittleEndianReader(content).u32();
    if (crc != 0 && crc != crc_before_) damage_.note("the checksum over all data is wrong");
    crc_ = 0;  // a new section: the summary, of which only the checksum is tested
  }

  void check_summary(std::span<const std::byte> footer) {
    ended_ = true;
    constexpr std::size_t kBeforeCrc = 16;
    if (footer.size() < kBeforeCrc + 4) return damage_.note("its last record is broken");
    const std::uint32_t crc = LittleEndianReader(footer.subspan(kBeforeCrc)).u32();
    const std::uint32_t found = crc_of(footer.first(kBeforeCrc), crc_of(head_, crc_before_));
    if (data_ended_ && crc != 0 && crc != found)
      damage_.note("the summary has a wrong checksum (it was not used)");
  }

  std::map<std::uint16_t, std::string> schemas_;
  std::map<std::uint16_t, std::size_t> channels_;
  std::vector<std::byte> head_, content_;
  std::uint32_t crc_{0};         ///< Of the section so far.
  std::uint32_t crc_before_{0};  ///< Without the newest record.
  bool data_ended_{false};
  bool ended_{false};
};

}  // namespace

Expected<std::unique_ptr<MessageLog>> open_mcap(const std::string& path) {
  return open_record_log<McapLog>(path);
}

}  // namespace fiducap
