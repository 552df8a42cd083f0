#include "capture/import/message_log.hpp"

#include <map>
#include <optional>
#include <string_view>

#include "base/bytes.hpp"
#include "capture/import/input_file.hpp"
#include "capture/import/record_log.hpp"

namespace fiducap {
namespace {

constexpr std::string_view kBagBegin = "#ROSBAG V";
constexpr std::string_view kBagVersion2 = "#ROSBAG V2.0\n";
constexpr std::uint64_t kLargestBagHeader_bytes = 1 << 20;
constexpr std::uint64_t kLargestConnection_bytes = 16 << 20;

enum BagOp : std::uint8_t { kNone = 0, kMessage = 2, kBagHeader = 3, kChunk = 5, kConnection = 7 };

/// The fields `name=value` of a record's header.
class BagFields final {
 public:
  /// @return nullopt when they are inconsistent
  static std::optional<BagFields> parse(std::span<const std::byte> bytes) {
    BagFields fields;
    LittleEndianReader from(bytes);
    while (from.left() > 0) {
      const auto field = from.bytes(from.u32());
      const std::size_t equals = text_of_bytes(field).find('=');
      if (from.failed() || equals == std::string_view::npos) return std::nullopt;
      fields.values_[std::string(text_of_bytes(field).substr(0, equals))] =
          field.subspan(equals + 1);
    }
    return fields;
  }

  [[nodiscard]] std::string_view text(const std::string& name) const {
    const auto found = values_.find(name);
    return found == values_.end() ? std::string_view() : text_of_bytes(found->second);
  }
  [[nodiscard]] std::uint8_t op() const {
    const std::string_view value = text("op");
    return value.size() == 1 ? static_cast<std::uint8_t>(value.front()) : std::uint8_t{0};
  }
  [[nodiscard]] std::optional<std::uint32_t> u32(const std::string& name) const {
    const auto found = values_.find(name);
    if (found == values_.end() || found->second.size() != 4) return std::nullopt;
    return LittleEndianReader(found->second).u32();
  }
  [[nodiscard]] std::optional<std::int64_t> time_ns(const std::string& name) const {
    const auto found = values_.find(name);
    if (found == values_.end() || found->second.size() != 8) return std::nullopt;
    LittleEndianReader from(found->second);
    const std::int64_t sec = from.u32();
    return sec * 1'000'000'000 + from.u32();
  }

 private:
  std::map<std::string, std::span<const std::byte>> values_;
};

struct BagRecord {
  std::uint8_t op{};
  BagFields fields;
  std::span<const std::byte> data;
};

class BagLog final : public RecordLog {
 public:
  explicit BagLog(InputFile file) : RecordLog(std::move(file)) {}

  Expected<void> begin() {
    std::vector<std::byte> magic;
    if (!file_.read(std::min<std::uint64_t>(kBagVersion2.size(), file_.size()), magic) ||
        !text_of_bytes(magic).starts_with(kBagBegin))
      return fail(ErrorCode::kInvalid, "is no bag of ROS 1", file_.path());
    if (text_of_bytes(magic) != kBagVersion2)
      return fail(ErrorCode::kUnsupported,
                  "is a bag of format " +
                      printable_name(text_of_bytes(magic).substr(kBagBegin.size())) +
                      "; only 2.0 is read: run `rosbag fix` on it where ROS 1 is installed",
                  file_.path());
    BagRecord record;
    if (!read_record(record) || record.op != kBagHeader)
      return fail(ErrorCode::kTruncated, "ends before its header: nothing was recorded",
                  file_.path());
    if (!record.fields.text("encryptor").empty())
      return fail(ErrorCode::kUnsupported, "is encrypted: decrypt it with `rosbag decrypt`",
                  file_.path());
    const std::string_view index = record.fields.text("index_pos");
    indexed_ = index.find_first_not_of('\0') != std::string_view::npos;
    return {};
  }

  Expected<bool> next(LoggedMessage& out) override {
    BagRecord record;
    for (;;) {
      const bool is_in_chunk = read_in_chunk(record);
      if (!is_in_chunk && !read_record(record)) return false;
      if (is_in_chunk && record.op == kChunk) {
        drop_chunk("a chunk contains a chunk");
        continue;
      }
      if (record.op == kConnection) add_connection(record);
      if (record.op == kChunk)
        unpack(record.fields.text("compression"), record.data,
               record.fields.u32("size").value_or(0));
      if (record.op == kMessage && take(record, out)) return true;
    }
  }

  std::vector<std::string> remarks() const override {
    std::vector<std::string> all;
    if (!damage_.cut_at && !indexed_)
      all.push_back("has no index (its recorder was killed): it was read from its start");
    damage_.append_to(all, file_.size());
    return all;
  }

 private:
  /// Of the file. @return false at the end of the complete part
  bool read_record(BagRecord& record) {
    const std::uint64_t began = file_.at();
    if (file_.left() == 0 || damage_.cut_at) return false;
    damage_.cut_at = began;  // until it is complete
    std::vector<std::byte> length;
    if (!file_.read(4, length)) return false;
    const std::uint64_t header = LittleEndianReader(length).u32();
    if (header > kLargestBagHeader_bytes || !file_.read(header, header_)) return false;
    auto fields = BagFields::parse(header_);
    if (!fields || !file_.read(4, length)) return false;
    const std::uint64_t data = LittleEndianReader(length).u32();
    record.op = fields->op();
    record.fields = std::move(*fields);
    const bool wanted = record.op == kChunk || record.op == kConnection || record.op == kMessage;
    const bool is_read = wanted && data <= kLargestChunk_bytes;
    if (!(is_read ? file_.read(data, data_) : file_.skip(data))) return false;
    if (wanted && !is_read) {
      damage_.note(std::string("a record ") + kChunkTooLarge);
      record.op = kNone;
    }
    record.data = is_read ? std::span<const std::byte>(data_) : std::span<const std::byte>();
    damage_.cut_at.reset();
    return true;
  }

  bool read_in_chunk(BagRecord& record) {
    if (chunk_at_ >= chunk_.size()) return false;
    LittleEndianReader from(std::span<const std::byte>(chunk_).subspan(chunk_at_));
    const auto header = from.bytes(from.u32());
    record.data = from.bytes(from.u32());
    chunk_at_ = chunk_.size() - from.left();
    auto fields = from.failed() ? std::nullopt : BagFields::parse(header);
    if (!fields) {
      drop_chunk("a record in a chunk is broken");
      return false;
    }
    record.op = fields->op();
    record.fields = std::move(*fields);
    return true;
  }

  void add_connection(const BagRecord& record) {
    const auto id = record.fields.u32("conn");
    const auto about = record.data.size() <= kLargestConnection_bytes
                           ? BagFields::parse(record.data)
                           : std::nullopt;
    if (!id || !about) return damage_.note("a connection is broken");
    if (by_connection_.contains(*id) || by_connection_.size() == kMostTopics) return;
    by_connection_[*id] = index_of({std::string(record.fields.text("topic")),
                                    std::string(about->text("type")), MessageFormat::kRos1});
  }

  bool take(const BagRecord& record, LoggedMessage& out) {
    const auto id = record.fields.u32("conn");
    const auto logged_ns = record.fields.time_ns("time");
    const auto topic = id ? by_connection_.find(*id) : by_connection_.end();
    if (topic == by_connection_.end() || !logged_ns) {
      damage_.note("a message belongs to no topic");
      return false;
    }
    out = {topic->second, *logged_ns, record.data};
    return true;
  }

  std::map<std::uint32_t, std::size_t> by_connection_;
  std::vector<std::byte> header_, data_;
  bool indexed_{true};
};

}  // namespace

Expected<std::unique_ptr<MessageLog>> open_bag(const std::string& path) {
  return open_record_log<BagLog>(path);
}

}  // namespace fiducap
