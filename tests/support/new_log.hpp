#pragma once

#include <string>

#include "base/log.hpp"

namespace fiducap {

/// What was logged since it was made.
class NewLog final {
 public:
  [[nodiscard]] std::string text() const {
    std::string all;
    for (const log::Line& line : log::lines_after(before_)) all += line.text + "\n";
    return all;
  }

 private:
  static std::uint64_t newest() {
    const auto lines = log::lines_after(0);
    return lines.empty() ? 0 : lines.back().number;
  }
  std::uint64_t before_{newest()};
};

}  // namespace fiducap
