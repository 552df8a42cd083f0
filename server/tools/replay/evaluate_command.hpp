#pragma once

#include <string>

#include "tools/replay/evaluation.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct EvaluateArguments {
  std::string tum;
  std::string recording;
  std::string plot;  ///< Pictures go there, .svg or .html; empty: none.
  bool json{false};
};

[[nodiscard]] std::string evaluation_text(const Evaluation& evaluation);
[[nodiscard]] std::string evaluation_json(const Evaluation& evaluation);

/// `fiducap evaluate`. @return exit code
[[nodiscard]] int run_evaluate(const EvaluateArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
