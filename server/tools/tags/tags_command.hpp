#pragma once

#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

struct TagSheetArguments {
  std::string ids{"0-11"};
  std::string family{"tag36h11"};
  std::string paper{"a4"};
  std::string out{"tags.pdf"};
  double size_mm{160};
  bool json{false};
};

/// `fiducap tags sheet`. @return exit code
[[nodiscard]] int run_tag_sheet(const TagSheetArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
