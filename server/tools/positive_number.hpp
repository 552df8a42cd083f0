#pragma once

#include <cmath>
#include <string>

#include <CLI/CLI.hpp>

namespace fiducap {

/// For options that are lengths, times or factors.
inline const CLI::Validator kPositive(
    [](std::string& text) {
      double value = 0;
      const bool good = CLI::detail::lexical_cast(text, value) && std::isfinite(value) && value > 0;
      return good ? std::string() : "must be a number > 0, is '" + text + "'";
    },
    "NUMBER>0");

}  // namespace fiducap
