#include "src/discovery.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <random>
#include <set>

#include "src/codec.hpp"

namespace fiducap::sdk {

namespace {

// One repetition, for lost datagrams.
constexpr std::chrono::milliseconds kAskAgain{150};
constexpr std::size_t kMostServers = 256;  // bound for forged replies

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

/// This machine, and the broadcast address of every attached network.
std::vector<in_addr> targets() {
  std::vector<in_addr> all{{htonl(INADDR_LOOPBACK)}};
  ifaddrs* interfaces = nullptr;
  if (::getifaddrs(&interfaces) != 0) return all;
  for (const ifaddrs* it = interfaces; it != nullptr; it = it->ifa_next) {
    if (it->ifa_addr == nullptr || it->ifa_addr->sa_family != AF_INET ||
        (it->ifa_flags & IFF_UP) == 0)
      continue;
    // Also the own address: a socket bound to it does not receive the broadcast.
    all.push_back(reinterpret_cast<const sockaddr_in*>(it->ifa_addr)->sin_addr);
    if ((it->ifa_flags & IFF_BROADCAST) != 0 && it->ifa_broadaddr != nullptr) {
      all.push_back(reinterpret_cast<const sockaddr_in*>(it->ifa_broadaddr)->sin_addr);
    }
  }
  ::freeifaddrs(interfaces);
  return all;
}

void ask(int fd, std::uint16_t port, const std::vector<std::uint8_t>& query) {
  for (const in_addr& address : targets()) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(port);
    to.sin_addr = address;
    // A network that refuses it has no reachable server.
    ::sendto(fd, query.data(), query.size(), MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&to),
             sizeof(to));
  }
}

std::string printable(std::string text) {
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return text;
}

/// Waits for one reply to our request until `until`. @return false when there was none
bool hear(int fd, std::chrono::steady_clock::time_point until, Decoder& decoder, in_addr& from) {
  const auto pause = std::chrono::duration_cast<std::chrono::milliseconds>(
      until - std::chrono::steady_clock::now());
  pollfd wanted{fd, POLLIN, 0};
  ::poll(&wanted, 1, std::max(0, static_cast<int>(pause.count())) + 1);
  std::array<std::uint8_t, kMaxDatagram + 1> bytes;
  sockaddr_in sender{};
  socklen_t sender_size = sizeof(sender);
  const auto size = ::recvfrom(fd, bytes.data(), bytes.size(), 0,
                               reinterpret_cast<sockaddr*>(&sender), &sender_size);
  from = sender.sin_addr;
  return size >= 0 && decoder.decode(bytes.data(), static_cast<std::size_t>(size)) ==
                          MessageKind::kDiscoveryReply;
}

std::string text_of(const in_addr& address) {
  char text[INET_ADDRSTRLEN] = "";
  ::inet_ntop(AF_INET, &address, text, sizeof(text));
  return text;
}

}  // namespace

std::vector<Client::Found> discover(std::chrono::milliseconds timeout, std::uint16_t port) {
  using Steady = std::chrono::steady_clock;
  std::vector<Client::Found> found;
  const Descriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const int on = 1;
  if (socket.get() < 0 ||
      ::setsockopt(socket.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof(on)) != 0)
    return found;
  std::random_device random;
  const std::uint64_t nonce = std::uint64_t{random()} << 32 | random();
  const auto query = encode_discovery_query(nonce);
  const auto end = Steady::now() + timeout;
  auto ask_at = Steady::now();
  int asked = 0;
  std::set<std::uint64_t> sessions;
  Decoder decoder;
  while (Steady::now() < end && sessions.size() < kMostServers) {
    if (asked < 2 && Steady::now() >= ask_at) {
      ask(socket.get(), port, query);
      ++asked;
      ask_at += kAskAgain;
    }
    in_addr from{};
    if (!hear(socket.get(), std::min(end, asked < 2 ? ask_at : end), decoder, from)) continue;
    const DiscoveryReply& reply = decoder.discovery_reply();
    if (reply.nonce != nonce || !sessions.insert(reply.session).second) continue;
    found.push_back({text_of(from), reply.port, printable(reply.host), printable(reply.version),
                     reply.body_count, reply.rate_hz});
  }
  return found;
}

}  // namespace fiducap::sdk
