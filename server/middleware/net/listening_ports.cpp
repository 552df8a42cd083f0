#include "middleware/net/listening_ports.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <utility>

namespace fiducap::net {
namespace {

/// Address and port of /proc/net: hexadecimal, the address in the machine's byte order.
std::optional<std::pair<std::string, std::uint16_t>> endpoint_of(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos || (colon != 8 && colon != 32)) return std::nullopt;
  if (text.find_first_not_of("0123456789ABCDEFabcdef:") != std::string::npos) return std::nullopt;
  const auto port = static_cast<std::uint16_t>(std::strtoul(text.c_str() + colon + 1, nullptr, 16));
  std::array<std::uint32_t, 4> words{};
  for (std::size_t i = 0; i < colon / 8; ++i)
    words.at(i) =
        static_cast<std::uint32_t>(std::strtoul(text.substr(8 * i, 8).c_str(), nullptr, 16));
  std::array<char, INET6_ADDRSTRLEN> name{};
  ::inet_ntop(colon == 8 ? AF_INET : AF_INET6, words.data(), name.data(), name.size());
  return std::pair(std::string(name.data()), port);
}

/// Owners of sockets by inode, of the processes that this user may inspect.
std::map<unsigned long, std::string> socket_owners() {
  namespace fs = std::filesystem;
  constexpr std::string_view kSocket = "socket:[";
  std::map<unsigned long, std::string> owners;
  std::error_code gone;
  for (const auto& process : fs::directory_iterator("/proc", gone)) {
    const std::string pid = process.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
    std::string name;
    std::getline(std::ifstream(process.path() / "comm"), name);
    for (const auto& file : fs::directory_iterator(process.path() / "fd", gone)) {
      const std::string target = fs::read_symlink(file.path(), gone).string();
      if (target.rfind(kSocket, 0) == 0)
        owners[std::strtoul(target.c_str() + kSocket.size(), nullptr, 10)] =
            name + " (process " + pid + ")";
    }
  }
  return owners;
}

}  // namespace

std::optional<ListeningPort> listening_port_of(const std::string& line, Transport transport) {
  constexpr const char* kTcpListens = "0A";
  constexpr const char* kUdpOpen = "07";
  std::istringstream words(line);
  std::string slot;
  std::string local;
  std::string remote;
  std::string state;
  if (!(words >> slot >> local >> remote >> state)) return std::nullopt;
  if (state != (transport == Transport::kTcp ? kTcpListens : kUdpOpen)) return std::nullopt;
  const auto endpoint = endpoint_of(local);
  if (!endpoint) return std::nullopt;
  ListeningPort port{transport, endpoint->first, endpoint->second};
  for (int skipped = 0; skipped < 5; ++skipped) words >> slot;  // queues, timers, user
  words >> port.inode;
  if (transport == Transport::kUdp) words >> slot >> slot >> port.discarded;  // references, address
  return port;
}

std::vector<ListeningPort> listening_ports() {
  std::vector<ListeningPort> all;
  for (const auto& [name, transport] :
       {std::pair("tcp", Transport::kTcp), std::pair("tcp6", Transport::kTcp),
        std::pair("udp", Transport::kUdp), std::pair("udp6", Transport::kUdp)}) {
    std::ifstream file(std::string("/proc/net/") + name);
    for (std::string line; std::getline(file, line);)
      if (auto port = listening_port_of(line, transport)) all.push_back(*port);
  }
  const auto owners = socket_owners();
  for (ListeningPort& port : all) {
    const auto owner = owners.find(port.inode);
    if (owner != owners.end()) port.owner = owner->second;
  }
  return all;
}

std::string owner_of(std::uint16_t port, Transport transport) {
  const auto all = listening_ports();
  const auto found = std::ranges::find_if(all, [&](const ListeningPort& one) {
    return one.port == port && one.transport == transport && !one.owner.empty();
  });
  if (found == all.end()) return "a program of another user";
  const bool own = found->owner.ends_with("(process " + std::to_string(::getpid()) + ")");
  return own ? "this process itself" : found->owner;
}

}  // namespace fiducap::net
