#pragma once

#include <string>
#include <vector>

#include "tools/terminal.hpp"

namespace fiducap {

struct CheckArguments {
  std::vector<std::string> recordings;
  bool json{false};
};

/// `fiducap check`: what is in a recording, and what is wrong with it. @return exit code
[[nodiscard]] int run_check(const CheckArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
