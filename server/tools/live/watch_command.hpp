#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "tools/terminal.hpp"

namespace fiducap {

struct WatchArguments {
  std::string server{"127.0.0.1"};  ///< HOST or HOST:PORT or [IPV6]:PORT
  double duration_s{0};             ///< 0: until Ctrl-C.
  bool json{false};
};

inline constexpr std::uint16_t kNativePort = 21600;

struct ServerAddress {
  std::string host;
  std::uint16_t port{};
};

/// @return nullopt when there is no host or the port is no number in 1..65535.
[[nodiscard]] std::optional<ServerAddress> parse_server_address(std::string_view text,
                                                                std::uint16_t default_port);

/// `fiducap watch`: poses as a client receives them. A table that stays in place for a person, one
/// line per body and second for a pipe, one JSON object per frame with --json.
/// @return exit code: failed when nothing arrived
[[nodiscard]] int run_watch(const WatchArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
