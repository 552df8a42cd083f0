#include "streaming/qualisys/codec.hpp"

#include <algorithm>
#include <array>

#include "base/bytes.hpp"

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
  return {in.u32(), in.u32()};
}

Header read_header(std::endian order, std::span<const std::byte> bytes) {
  return order == std::endian::big ? read_header<BigEndianReader>(bytes)
                                   : read_header<LittleEndianReader>(bytes);
}

constexpr std::string_view kSpaces = " \t\r\n";
constexpr std::uint32_t kMaxNumber = 100'000;  // Hz, or frames to the next one

/// `AllFrames`, `Frequency:n` or `FrequencyDivisor:n`.
std::optional<Rate> parse_rate(std::string_view word) {
  if (same_word(word, "AllFrames")) return Rate{};
  const auto colon = word.find(':');
  if (colon == std::string_view::npos) return std::nullopt;
  const std::string_view kind = word.substr(0, colon);
  const auto n = whole_number<std::uint32_t>(word.substr(colon + 1));
  if (!n || *n < 1 || *n > kMaxNumber) return std::nullopt;
  if (same_word(kind, "Frequency")) return Rate{RateKind::kFrequency, *n};
  if (same_word(kind, "FrequencyDivisor")) return Rate{RateKind::kFrequencyDivisor, *n};
  return std::nullopt;
}

/// `UDP:port` or `UDP:address:port`. @return it is valid
bool parse_udp(std::string_view word, StreamRequest& request) {
  const std::string_view target = word.substr(word.find(':') + 1);
  const auto colon = target.rfind(':');
  const std::string_view port = colon == std::string_view::npos ? target : target.substr(colon + 1);
  request.udp_port = whole_number<std::uint16_t>(port);
  if (colon != std::string_view::npos) request.udp_address = target.substr(0, colon);
  return request.udp_port >= kLowestUdpPort;
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

std::optional<std::uint16_t> decode_discover(std::span<const std::byte> datagram) {
  if (datagram.size() != kDiscoverSize) return std::nullopt;
  const auto is_question = [](const Header& h) {
    return h.size == kDiscoverSize && h.type == static_cast<std::uint32_t>(PacketType::kDiscover);
  };
  if (!is_question(read_header(std::endian::little, datagram)) &&
      !is_question(read_header(std::endian::big, datagram))) {
    return std::nullopt;
  }
  const std::uint16_t port = BigEndianReader(datagram.subspan(kHeaderSize)).u16();
  return port < kLowestUdpPort ? std::nullopt : std::optional(port);
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

std::optional<Components> parse_components(std::string_view words) {
  Components components;
  for (const std::string_view word : words_of(words)) {
    if (same_word(word, "All")) return Components::all();
    const std::string_view plain = word.substr(0, word.find(':'));  // options: Skeleton:global
    for (const auto& known : kComponentWords)
      if (same_word(plain, known.word)) components.add(known.component);
  }
  return components.empty() ? std::nullopt : std::optional(components);
}

std::optional<StreamRequest> parse_stream_request(std::string_view words) {
  const Command first = split_command(words);
  const Command second = split_command(first.rest);
  const bool by_udp = same_word(second.name.substr(0, 4), "UDP:");
  const auto rate = parse_rate(first.name);
  const auto components = parse_components(by_udp ? second.rest : first.rest);
  if (!rate || !components) return std::nullopt;
  StreamRequest request{*rate, {}, {}, *components};
  if (by_udp && !parse_udp(second.name, request)) return std::nullopt;
  return request;
}

std::optional<Version> parse_version(std::string_view word) {
  if (!word.starts_with("1.")) return std::nullopt;
  const auto minor = whole_number<int>(word.substr(2));
  if (!minor || *minor < 0 || *minor > Version::kNewest) return std::nullopt;
  return Version{*minor};
}

std::optional<ParameterGroups> parse_parameter_groups(std::string_view words) {
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
  return groups.any() ? std::optional(groups) : std::nullopt;
}

}  // namespace fiducap::qualisys
