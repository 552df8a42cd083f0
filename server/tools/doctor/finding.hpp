#pragma once

#include <string>
#include <vector>

namespace fiducap {

/// One thing that `fiducap doctor` says.
struct Finding {
  enum class Grade { kOk, kWarning, kFault };

  Grade grade{Grade::kOk};
  std::string text;
  std::string remedy{};  ///< What to do; empty only when all is well.
};

using Findings = std::vector<Finding>;

}  // namespace fiducap
