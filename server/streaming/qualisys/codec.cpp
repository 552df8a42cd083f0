#include "streaming/qualisys/codec.hpp"

#include <string>

#include "base/byte_reader.hpp"
#include "base/byte_writer.hpp"

namespace fiducap::qualisys {

namespace {

/// The same writing in the order that the client's port stands for.
template <class Write>
void in_order(std::endian order, std::vector<std::byte>& out, Write&& write) {
  if (order == std::endian::big) {
    write(BigEndianWriter(out));
  } else {
    write(LittleEndianWriter(out));
  }
}

struct Header {
  std::uint32_t size{};
  std::uint32_t type{};
};

template <class Reader>
Header read_header(std::span<const std::byte> bytes) {
  Reader in(bytes);
  Header header;
  header.size = in.u32();
  header.type = in.u32();
  return header;
}

Header read_header(std::endian order, std::span<const std::byte> bytes) {
  return order == std::endian::big ? read_header<BigEndianReader>(bytes)
                                   : read_header<LittleEndianReader>(bytes);
}

}  // namespace

void encode_text(std::endian order, PacketType type, std::string_view text,
                 std::vector<std::byte>& out) {
  in_order(order, out, [&](auto writer) {
    writer.u32(static_cast<std::uint32_t>(kHeaderSize + text.size() + 1))
        .u32(static_cast<std::uint32_t>(type))
        .text(text)
        .u8(0);
  });
}

void encode_event(std::endian order, Event event, std::vector<std::byte>& out) {
  in_order(order, out, [&](auto writer) {
    writer.u32(kHeaderSize + 1)
        .u32(static_cast<std::uint32_t>(PacketType::kEvent))
        .u8(static_cast<std::uint8_t>(event));
  });
}

void encode_no_more_data(std::endian order, std::vector<std::byte>& out) {
  in_order(order, out, [&](auto writer) {
    writer.u32(kHeaderSize).u32(static_cast<std::uint32_t>(PacketType::kNoMoreData));
  });
}

Expected<std::optional<Packet>> decode_packet(std::endian order, std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderSize) return std::nullopt;
  const Header header = read_header(order, bytes);
  if (header.size < kHeaderSize || header.size > kMaxIncoming) {
    return fail(ErrorCode::kInvalid, "expected a packet of " + std::to_string(kHeaderSize) +
                                         " to " + std::to_string(kMaxIncoming) +
                                         " bytes, its header says " + std::to_string(header.size));
  }
  if (bytes.size() < header.size) return std::nullopt;
  return Packet{static_cast<PacketType>(header.type),
                bytes.subspan(kHeaderSize, header.size - kHeaderSize), header.size};
}

std::string_view decode_text(std::span<const std::byte> payload) {
  const std::string_view text(reinterpret_cast<const char*>(payload.data()), payload.size());
  return text.substr(0, text.find('\0'));
}

Expected<std::uint16_t> decode_discover(std::span<const std::byte> datagram) {
  if (datagram.size() != kDiscoverSize) {
    return fail(ErrorCode::kInvalid,
                "expected a discover packet of 10 bytes, came " + std::to_string(datagram.size()));
  }
  const auto is_question = [](const Header& h) {
    return h.size == kDiscoverSize && h.type == static_cast<std::uint32_t>(PacketType::kDiscover);
  };
  if (!is_question(read_header(std::endian::little, datagram)) &&
      !is_question(read_header(std::endian::big, datagram))) {
    return fail(ErrorCode::kInvalid, "expected a discover packet (size 10, type 7)");
  }
  BigEndianReader in(datagram.subspan(kHeaderSize));
  const std::uint16_t port = in.u16();
  if (port < kLowestUdpPort) {
    return fail(ErrorCode::kInvalid,
                "expected an answer port from 1024, came " + std::to_string(port));
  }
  return port;
}

void encode_discover_answer(std::string_view about, std::uint16_t base_port,
                            std::vector<std::byte>& out) {
  LittleEndianWriter(out)
      .u32(static_cast<std::uint32_t>(kHeaderSize + about.size() + 1 + 2))
      .u32(static_cast<std::uint32_t>(PacketType::kCommand))
      .text(about)
      .u8(0);
  BigEndianWriter(out).u16(base_port);
}

}  // namespace fiducap::qualisys
