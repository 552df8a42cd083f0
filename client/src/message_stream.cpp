#include "src/message_stream.hpp"

#include <array>

namespace fiducap::sdk {

namespace {

constexpr std::uint32_t kMaxMessage = 1 << 20;  // of a reply: 1024 bodies need 250 KiB

}  // namespace

std::string MessageStream::open(const std::string& host, std::uint16_t port, Deadline deadline,
                                v1::ControlHello& hello) {
  if (auto problem = tcp_.open(host, port, deadline); !problem.empty()) return problem;
  v1::ControlReply first;
  if (auto problem = read(first, deadline); !problem.empty()) {
    return problem + " (too many connections or wrong tokens from here, or not a Fiducap server)";
  }
  if (!first.has_hello()) {
    tcp_.close();
    return first.text().empty() ? "the server sent no greeting" : first.text();
  }
  hello = first.hello();
  return {};
}

std::string MessageStream::write(const v1::ControlRequest& request, Deadline deadline) {
  std::string bytes(4, '\0');
  request.AppendToString(&bytes);
  for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<char>((bytes.size() - 4) >> (8 * i));
  return tcp_.write(bytes.data(), bytes.size(), deadline);
}

std::string MessageStream::read(v1::ControlReply& reply, Deadline deadline) {
  std::array<std::uint8_t, 4> length{};
  auto problem = tcp_.read(length.data(), length.size(), deadline);
  if (!problem.empty()) return problem;
  const std::uint32_t size = length[0] | std::uint32_t{length[1]} << 8 |
                             std::uint32_t{length[2]} << 16 | std::uint32_t{length[3]} << 24;
  std::string bytes(size <= kMaxMessage ? size : 0, '\0');
  if (size <= kMaxMessage) problem = tcp_.read(bytes.data(), bytes.size(), deadline);
  if (!problem.empty()) return problem;
  if (size <= kMaxMessage && reply.ParseFromString(bytes)) return {};
  tcp_.close();
  return "the reply is not of this protocol";
}

}  // namespace fiducap::sdk
