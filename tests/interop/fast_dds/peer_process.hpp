#pragma once

#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/child_process.hpp"

namespace fiducap::dds {

/// What the other vendor's subscriber printed about one topic.
struct Heard {
  int count{};         ///< Messages.
  int ids{};           ///< Different keys.
  int incompatible{};  ///< QoS policy that did not fit; 0: none.
  std::string last;    ///< The newest message.
};

/// `fast_dds_peer`, or `cyclone_peer`, as a child process.
class PeerProcess final : public ChildProcess {
 public:
  explicit PeerProcess(std::vector<std::string> arguments, const char* program = FAST_DDS_PEER)
      : ChildProcess(with_program(std::move(arguments), program)) {}

  /// Waits for its end. By topic, as on the wire.
  [[nodiscard]] std::map<std::string, Heard> heard() {
    (void)exit_code();
    std::map<std::string, Heard> all;
    std::istringstream lines(output());
    for (std::string line; std::getline(lines, line);) {
      const auto last = line.find("last: ");
      if (last == std::string::npos) continue;
      const auto number = [&line](const std::string& key) {
        const auto at = line.find(key + "=");
        return at == std::string::npos ? 0 : std::atoi(line.c_str() + at + key.size() + 1);
      };
      all[line.substr(0, line.find(' '))] = {number("count"), number("ids"), number("incompatible"),
                                             line.substr(last + 6)};
    }
    return all;
  }

 private:
  static std::vector<std::string> with_program(std::vector<std::string> arguments,
                                               const char* program) {
    arguments.insert(arguments.begin(), program);
    return arguments;
  }
};

}  // namespace fiducap::dds
