#include "rt_client.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace fiducap::qualisys {

namespace {

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

}  // namespace

RtClient::RtClient(std::uint16_t port, std::endian order)
    : order_(order), tcp_(::socket(AF_INET, SOCK_STREAM, 0)) {
  const sockaddr_in server = loopback(port);
  closed = ::connect(tcp_, reinterpret_cast<const sockaddr*>(&server), sizeof(server)) != 0;
}

RtClient::~RtClient() {
  ::close(tcp_);
  if (udp_ >= 0) ::close(udp_);
}

void RtClient::say(std::string_view command) {
  std::vector<std::byte> out;
  encode_text(order_, PacketType::kCommand, command, out);
  send(out);
}

void RtClient::send(std::span<const std::byte> bytes) {
  closed = ::send(tcp_, bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0 || closed;
}

std::uint16_t RtClient::open_udp() {
  udp_ = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in own = loopback(0);
  socklen_t size = sizeof(own);
  ::bind(udp_, reinterpret_cast<const sockaddr*>(&own), size);
  ::getsockname(udp_, reinterpret_cast<sockaddr*>(&own), &size);
  return ntohs(own.sin_port);
}

void RtClient::pump() {
  std::array<std::byte, 70'000> buffer{};
  for (;;) {
    const auto n = ::recv(tcp_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN)) closed = true;
    if (n <= 0) break;
    in_.insert(in_.end(), buffer.begin(), buffer.begin() + n);
  }
  std::size_t used = 0;
  for (;;) {
    const auto rest = std::span<const std::byte>(in_).subspan(used);
    const auto packet = decode_packet(order_, rest);
    if (!packet || !*packet) break;
    switch ((*packet)->type) {
      case PacketType::kData:
        tcp_frames.emplace_back(rest.begin(),
                                rest.begin() + static_cast<std::ptrdiff_t>((*packet)->size));
        break;
      case PacketType::kEvent:
        events.push_back(static_cast<Event>((*packet)->payload[0]));
        break;
      case PacketType::kNoMoreData:
        ++no_more_data;
        break;
      default:
        texts.emplace_back(decode_text((*packet)->payload));
    }
    used += (*packet)->size;
  }
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
  while (udp_ >= 0) {
    const auto n = ::recv(udp_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n <= 0) break;
    udp_frames.emplace_back(buffer.begin(), buffer.begin() + n);
  }
}

bool RtClient::heard(std::string_view text) const {
  return std::find(texts.begin(), texts.end(), text) != texts.end();
}

}  // namespace fiducap::qualisys
