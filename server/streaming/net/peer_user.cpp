#include "streaming/net/peer_user.hpp"

#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>

namespace fiducap::net {

namespace {

/// As /proc/net/tcp6 writes an address: four words of the machine's own order, then the port.
std::string words_of(const Peer& peer, std::size_t first_byte) {
  std::string text;
  std::array<char, 16> word{};
  for (std::size_t i = first_byte; i < peer.address.size(); i += 4) {
    std::uint32_t value{};
    std::memcpy(&value, peer.address.data() + i, sizeof value);
    std::snprintf(word.data(), word.size(), "%08X", value);
    text += word.data();
  }
  std::snprintf(word.data(), word.size(), ":%04X", static_cast<unsigned>(peer.port));
  return text + word.data();
}

/// The line of that local address: `sl local rem st queues timer retransmits uid …`.
std::optional<unsigned> user_in(const char* table, const std::string& local) {
  std::ifstream file(table);
  std::string line;
  std::getline(file, line);  // what the columns are
  while (std::getline(file, line)) {
    std::istringstream columns(line);
    std::string number, address, skipped;
    columns >> number >> address;
    if (address != local) continue;
    for (int i = 0; i < 5; ++i) columns >> skipped;
    unsigned user{};
    if (columns >> user) return user;
  }
  return std::nullopt;
}

std::optional<unsigned> user_behind_sudo() {
  const char* const text = std::getenv("SUDO_UID");
  unsigned user{};
  if (text == nullptr || std::sscanf(text, "%u", &user) != 1) return std::nullopt;
  return user;
}

}  // namespace

std::optional<unsigned> user_of(const Peer& peer) {
  constexpr std::size_t kLastWord = 12;
  if (peer.is_ipv4())
    if (const auto user = user_in("/proc/self/net/tcp", words_of(peer, kLastWord))) return user;
  return user_in("/proc/self/net/tcp6", words_of(peer, 0));
}

bool is_of_this_user(const Peer& peer) {
  const auto user = user_of(peer);
  return user &&
         (*user == 0 || *user == ::geteuid() || (::geteuid() == 0 && user == user_behind_sudo()));
}

}  // namespace fiducap::net
