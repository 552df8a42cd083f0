#include "streaming/natnet/request.hpp"

#include <algorithm>

#include "base/byte_reader.hpp"
#include "streaming/natnet/wire.hpp"

namespace fiducap::natnet {

namespace {

// Sender block: char name[256], u8 application version[4], u8 library version[4]; then, from 4.x
// on, the options: u8 subscribed data only, u8 wanted bitstream[4].
constexpr std::size_t kSenderName = 256;
constexpr std::size_t kSenderBlock = 264;
constexpr std::size_t kSenderWithOptions = 269;
constexpr std::size_t kShownName = 64;

std::string_view text_until_nul(std::span<const std::byte> bytes) {
  const std::string_view all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return all.substr(0, all.find('\0'));
}

std::string printable(std::string_view text) {
  std::string safe(text.substr(0, kShownName));
  for (char& c : safe) {
    if (c < ' ' || c > '~') c = '?';
  }
  return safe;
}

struct Sender {
  std::string name;
  ClientVersions versions;
  bool subscribed_data_only{};
};

Bitstream read_version(LittleEndianReader& in) {
  const Bitstream version{in.u8(), in.u8()};
  in.bytes(2);  // revision and build say nothing about the layout
  return version;
}

/// @return nothing but a name ("Ping") when the payload has no sender block.
Sender read_sender(std::span<const std::byte> payload) {
  Sender sender;
  sender.name = printable(text_until_nul(payload.first(std::min(payload.size(), kSenderName))));
  if (payload.size() < kSenderBlock) return sender;
  LittleEndianReader in(payload.subspan(kSenderName));
  in.bytes(4);  // version of the client's application
  sender.versions.library = read_version(in);
  if (payload.size() < kSenderWithOptions) return sender;
  sender.subscribed_data_only = in.u8() != 0;
  sender.versions.wanted = read_version(in);
  return sender;
}

Request to_connect(std::span<const std::byte> payload) {
  Sender sender = read_sender(payload);
  return ConnectRequest{std::move(sender.name), sender.versions, sender.subscribed_data_only,
                        payload.empty()};
}

Request to_keep_alive(std::span<const std::byte> payload) {
  Sender sender = read_sender(payload);
  return KeepAliveRequest{std::move(sender.name), sender.versions};
}

Expected<Request> to_echo(std::span<const std::byte> payload) {
  LittleEndianReader in(payload);
  const EchoRequest echo{in.u64()};
  if (const auto ok = in.check("EchoRequest"); !ok) return tl::unexpected(ok.error());
  return echo;
}

Request to_model(std::span<const std::byte> payload) {
  LittleEndianReader in(payload);
  const std::uint32_t types = in.u32();
  return in.failed() ? ModelRequest{} : ModelRequest{types};  // none, or one NUL: everything
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

}  // namespace

Expected<Request> decode_request(std::span<const std::byte> datagram) {
  LittleEndianReader header(datagram);
  const std::uint16_t message = header.u16();
  const std::size_t announced = header.u16();
  if (const auto ok = header.check("header"); !ok) return tl::unexpected(ok.error());
  const auto rest = datagram.subspan(kHeaderSize);
  const auto payload = rest.first(std::min(announced, rest.size()));
  switch (static_cast<Message>(message)) {
    case Message::kConnect:
      return to_connect(payload);
    case Message::kDiscovery:
      return DiscoveryRequest{read_sender(payload).versions};
    case Message::kKeepAlive:
      return to_keep_alive(payload);
    case Message::kDisconnect:
      return DisconnectRequest{};
    case Message::kEchoRequest:
      return to_echo(payload);
    case Message::kRequestModel:
      return to_model(payload);
    case Message::kRequestFrame:
      return FrameRequest{};
    case Message::kRequest:
      return CommandRequest{text_until_nul(payload)};
    default:
      break;
  }
  return fail(ErrorCode::kUnsupported,
              "expected a request of a client, came message " + std::to_string(message));
}

Command parse_command(std::string_view text) {
  Command command;
  auto comma = text.find(',');
  command.word = trimmed(text.substr(0, comma));
  while (comma != std::string_view::npos && command.count < Command::kMostArguments) {
    text.remove_prefix(comma + 1);
    comma = command.count + 1 < Command::kMostArguments ? text.find(',') : std::string_view::npos;
    command.arguments[command.count++] = trimmed(text.substr(0, comma));
  }
  return command;
}

}  // namespace fiducap::natnet
