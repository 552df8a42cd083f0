#pragma once

#include <ctime>

#include <cstdint>
#include <iostream>
#include <map>
#include <string>
#include <string_view>

namespace fiducap {

/// Time of a clock of the system, e.g. CLOCK_MONOTONIC.
[[nodiscard]] inline std::int64_t read_ns(clockid_t id) {
  timespec t{};
  clock_gettime(id, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

/// Arguments `key=value` of a program.
class KeyValues final {
 public:
  [[nodiscard]] bool has(const std::string& key) const { return values_.contains(key); }
  [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise = {}) const {
    return has(key) ? values_.at(key) : otherwise;
  }
  [[nodiscard]] double number(const std::string& key, double otherwise) const {
    return has(key) ? std::stod(values_.at(key)) : otherwise;
  }
  /// @return false: an argument has another form
  [[nodiscard]] bool parse(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
      const std::string_view argument = argv[i];
      const auto equals = argument.find('=');
      if (equals == std::string_view::npos) {
        std::cerr << "expected key=value, got " << argument << '\n';
        return false;
      }
      values_[std::string(argument.substr(0, equals))] = argument.substr(equals + 1);
    }
    return true;
  }

 private:
  std::map<std::string, std::string> values_;
};

}  // namespace fiducap
