#pragma once

#include <cstdint>
#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

struct ControlArguments {
  std::string server{"127.0.0.1"};  ///< HOST or HOST:PORT of the native protocol.
  std::string token;                ///< Empty: the environment's FIDUCAP_TOKEN.
  std::string body;                 ///< Name or id.
  std::string name;                 ///< New name of the body, of the recording or of the version.
  std::int64_t version{};           ///< Of the map.
  int tag_id{};
  std::string measured;  ///< File with measured places of tags.
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
[[nodiscard]] int run_control_name(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_rollback(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_align(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_quarantine(const ControlArguments& arguments,
                                         const Terminal& terminal);
[[nodiscard]] int run_control_forget(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_record(const ControlArguments& arguments, const Terminal& terminal);
[[nodiscard]] int run_control_stop(const ControlArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
