#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/import/input_file.hpp"
#include "capture/import/message_log.hpp"

namespace fiducap {

/// The parts of a log that could not be read.
struct LogDamage {
  std::optional<std::uint64_t> cut_at{};  ///< Complete bytes of a truncated file.
  std::uint64_t parts{0};                 ///< Left out.
  std::string first{};                    ///< Fault of the first of them.

  void note(std::string fault) {
    if (parts++ == 0) first = std::move(fault);
  }
  void append_to(std::vector<std::string>& remarks, std::uint64_t file_bytes) const {
    if (cut_at)
      remarks.push_back("is truncated: of " + std::to_string(file_bytes) + " bytes the first " +
                        std::to_string(*cut_at) + " are complete, and were read");
    if (parts > 0)
      remarks.push_back("has " + std::to_string(parts) +
                        " damaged parts, which were left out; the first: " + first);
  }
};

/// A log of records, some of them packed in chunks: bag and MCAP.
class RecordLog : public MessageLog {
 public:
  double share() const final { return file_.share(); }

 protected:
  explicit RecordLog(InputFile file) : file_(std::move(file)), budget_(file_.size()) {}

  /// Fills `chunk_`; empty when it is damaged. Not from a chunk, which could contain itself.
  bool unpack(std::string_view compression, std::span<const std::byte> packed,
              std::uint64_t stated_bytes) {
    chunk_at_ = 0;
    const auto unpacked = unpack_chunk(compression, packed, stated_bytes, budget_, chunk_);
    if (!unpacked) drop_chunk("a chunk " + unpacked.error().what);
    return unpacked.has_value();
  }
  void drop_chunk(std::string fault) {
    chunk_.clear();
    damage_.note(std::move(fault));
  }

  InputFile file_;
  std::vector<std::byte> chunk_;
  std::size_t chunk_at_{0};  ///< Next record in it.
  LogDamage damage_;

 private:
  UnpackBudget budget_;
};

/// @tparam Log  a RecordLog with `Expected<void> begin()`
template <class Log>
Expected<std::unique_ptr<MessageLog>> open_record_log(const std::string& path) {
  auto file = InputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  auto log = std::make_unique<Log>(std::move(*file));
  return log->begin().map([&] { return std::move(log); });
}

}  // namespace fiducap
