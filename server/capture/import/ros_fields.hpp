#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <variant>

#include "base/byte_reader.hpp"
#include "base/expected.hpp"
#include "capture/import/message_log.hpp"

namespace fiducap {

/// Takes the fields of one message of ROS, one after the other: ROS 1 packs them, CDR aligns each
/// number to its own size and says its byte order in front. Never reads past the end, see
/// ByteReader.
class RosFields final {
 public:
  /// @return Error for a format or a kind of CDR that is not known
  [[nodiscard]] static Expected<RosFields> open(MessageFormat format,
                                                std::span<const std::byte> message);

  std::uint8_t u8();
  std::uint32_t u32();
  double f64();
  void skip_f64s(std::size_t n);
  std::string_view text();
  /// The bytes of a sequence of uint8.
  std::span<const std::uint8_t> bytes();
  /// How many entries of a sequence follow. Fails when so many of `entry_bytes` are not there.
  std::size_t count(std::size_t entry_bytes);
  /// Of a Header: nanoseconds since 1970; the name of its axes is passed over.
  std::int64_t header_stamp_ns();

  [[nodiscard]] Expected<void> check(const char* what) const;

 private:
  RosFields(std::variant<LittleEndianReader, BigEndianReader> from, bool aligned, std::size_t size)
      : from_(std::move(from)), aligned_(aligned), size_(size) {}
  void align(std::size_t to);
  std::span<const std::byte> raw(std::size_t n);

  std::variant<LittleEndianReader, BigEndianReader> from_;
  bool aligned_;
  std::size_t size_;
};

}  // namespace fiducap
