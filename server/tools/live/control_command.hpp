#pragma once

#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

struct ControlArguments {
  std::string server{"127.0.0.1"};  ///< HOST or HOST:PORT of the native protocol.
  std::string token;                ///< Empty: the environment's FIDUCAP_TOKEN.
  std::string body;                 ///< Name or id.
  std::string name;                 ///< New name of the body, or of the recording.
  bool json{false};
  double patience_s{10};  ///< With a disk that takes nothing of a recording.
};

/// `fiducap control …`: what the operator may change on a running server.
/// @return exit code: failed when the server refused, with its reason
[[nodiscard]] int run_control_list(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_enable(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_disable(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_rename(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_freeze(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_map(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_commit(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_record(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_stop(const ControlArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
