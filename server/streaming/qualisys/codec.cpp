#include "streaming/qualisys/codec.hpp"

#include <algorithm>
#include <array>

#include "base/bytes.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap::qualisys {

namespace {

/// Writes in the byte order of the client's port.
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

constexpr std::string_view kSpaces = " \t\r\n";
constexpr std::uint32_t kMaxNumber = 100'000;  // Hz, or frames to the next one

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

Expected<Rate> parse_rate(std::string_view word) {
  if (same_word(word, "AllFrames")) return Rate{};
  const auto colon = word.find(':');
  const std::string_view kind = word.substr(0, colon);
  const auto n = colon == std::string_view::npos
                     ? std::nullopt
                     : whole_number<std::uint32_t>(word.substr(colon + 1));
  if (n && *n >= 1 && *n <= kMaxNumber) {
    if (same_word(kind, "Frequency")) return Rate{RateKind::kFrequency, *n};
    if (same_word(kind, "FrequencyDivisor")) return Rate{RateKind::kFrequencyDivisor, *n};
  }
  return fail(ErrorCode::kInvalid, "expected AllFrames, Frequency:n or FrequencyDivisor:n, got \"" +
                                       std::string(word) + "\"");
}

/// `UDP:port` or `UDP:address:port`.
Expected<void> parse_udp(std::string_view word, StreamRequest& request) {
  const std::string_view target = word.substr(word.find(':') + 1);
  const auto colon = target.rfind(':');
  const std::string_view port = colon == std::string_view::npos ? target : target.substr(colon + 1);
  const auto number = whole_number<std::uint16_t>(port);
  if (!number || *number < kLowestUdpPort)
    return fail(ErrorCode::kInvalid,
                "expected a UDP port from 1024, got \"" + std::string(port) + "\"");
  request.udp_port = *number;
  if (colon != std::string_view::npos) request.udp_address = target.substr(0, colon);
  return {};
}

bool begins_with_word(std::string_view text, std::string_view word) {
  return text.size() >= word.size() && same_word(text.substr(0, word.size()), word);
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
  if (header.size < kHeaderSize || header.size > kMaxIncoming)
    return fail(ErrorCode::kInvalid, "expected a packet of " + std::to_string(kHeaderSize) +
                                         " to " + std::to_string(kMaxIncoming) +
                                         " bytes, got one of " + std::to_string(header.size));
  if (bytes.size() < header.size) return std::nullopt;
  return Packet{static_cast<PacketType>(header.type),
                bytes.subspan(kHeaderSize, header.size - kHeaderSize), header.size};
}

std::string_view decode_text(std::span<const std::byte> payload) { return until_zero(payload); }

Expected<std::uint16_t> decode_discover(std::span<const std::byte> datagram) {
  if (datagram.size() != kDiscoverSize)
    return fail(ErrorCode::kInvalid,
                "expected a discover packet of 10 bytes, got " + std::to_string(datagram.size()));
  const auto is_question = [](const Header& h) {
    return h.size == kDiscoverSize && h.type == static_cast<std::uint32_t>(PacketType::kDiscover);
  };
  if (!is_question(read_header(std::endian::little, datagram)) &&
      !is_question(read_header(std::endian::big, datagram))) {
    return fail(ErrorCode::kInvalid, "expected a discover packet (size 10, type 7)");
  }
  BigEndianReader in(datagram.subspan(kHeaderSize));
  const std::uint16_t port = in.u16();
  if (port < kLowestUdpPort)
    return fail(ErrorCode::kInvalid,
                "expected an answer port from 1024, got " + std::to_string(port));
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

bool same_word(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](char x, char y) { return lower(x) == lower(y); });
}

bool Command::is(std::string_view word) const { return same_word(name, word); }

Command split_command(std::string_view text) {
  const std::string_view line = trimmed(text);
  const auto end = std::min(line.find_first_of(kSpaces), line.size());
  return {line.substr(0, end), trimmed(line.substr(end))};
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  for (;;) {
    const Command next = split_command(text);
    if (next.name.empty()) return words;
    words.push_back(next.name);
    text = next.rest;
  }
}

Expected<Components> parse_components(std::string_view words) {
  Components components;
  for (const std::string_view word : words_of(words)) {
    if (same_word(word, "All")) return Components::all();
    const std::string_view plain = word.substr(0, word.find(':'));  // options: Skeleton:global
    for (const auto& known : kComponentWords)
      if (same_word(plain, known.word)) components.add(known.component);
  }
  if (components.empty())
    return fail(ErrorCode::kInvalid,
                "expected components, e.g. 6D, got \"" + std::string(words) + "\"");
  return components;
}

Expected<StreamRequest> parse_stream_request(std::string_view words) {
  StreamRequest request;
  const Command first = split_command(words);
  const auto rate = parse_rate(first.name);
  if (!rate) return tl::unexpected(rate.error());
  request.rate = *rate;
  std::string_view rest = first.rest;
  const Command second = split_command(rest);
  if (begins_with_word(second.name, "UDP:")) {
    if (const auto done = parse_udp(second.name, request); !done)
      return tl::unexpected(done.error());
    rest = second.rest;
  }
  const auto components = parse_components(rest);
  if (!components) return tl::unexpected(components.error());
  request.components = *components;
  return request;
}

std::optional<Version> parse_version(std::string_view word) {
  if (!word.starts_with("1.")) return std::nullopt;
  const auto minor = whole_number<int>(word.substr(2));
  if (!minor || *minor < 0 || *minor > Version::kNewest) return std::nullopt;
  return Version{*minor};
}

Expected<ParameterGroups> parse_parameter_groups(std::string_view words) {
  static constexpr std::array<std::string_view, 8> kOthers{
      "Analog", "Force", "Image", "GazeVector", "EyeTracker", "Skeleton", "Calibration", "2D"};
  ParameterGroups groups;
  for (const std::string_view word : words_of(words)) {
    const std::string_view plain = word.substr(0, word.find(':'));
    const bool all = same_word(plain, "All");
    groups.general = groups.general || all || same_word(plain, "General");
    groups.three_d = groups.three_d || all || same_word(plain, "3D");
    groups.six_d = groups.six_d || all || same_word(plain, "6D");
    groups.others = groups.others || std::ranges::any_of(kOthers, [&](auto known) {
                      return same_word(plain, known);
                    });
  }
  if (groups.any()) return groups;
  return fail(ErrorCode::kInvalid,
              "expected General, 3D, 6D … or All, got \"" + std::string(words) + "\"");
}

}  // namespace fiducap::qualisys
