#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/config_check.hpp"
#include "base/expected.hpp"

namespace fiducap {

template <typename Fault>
auto fault_text(const Fault& fault) -> decltype(fault.text()) {
  return fault.text();
}
template <typename Fault>
std::string fault_text(const std::vector<Fault>& faults) {
  std::string all;
  for (const Fault& fault : faults) all += fault.text() + "\n";
  return all;
}

/// The value of a result; an error fails the test with its text.
template <typename T, typename E>
T value_of(tl::expected<T, E> result) {
  if (!result) throw std::runtime_error(fault_text(result.error()));
  return std::move(*result);
}
template <typename E>
void value_of(tl::expected<void, E> result) {
  if (!result) throw std::runtime_error(fault_text(result.error()));
}
template <typename T>
T value_of(std::optional<T> result) {
  if (!result) throw std::runtime_error("no value");
  return std::move(*result);
}

/// Text of a result's error; "no error" without one.
template <typename T, typename E>
std::string error_of(const tl::expected<T, E>& result) {
  return result ? "no error" : fault_text(result.error());
}

/// Paths of broken rules.
inline std::vector<std::string> paths_of(const std::vector<ConfigError>& errors) {
  std::vector<std::string> paths;
  for (const ConfigError& error : errors) paths.push_back(error.path);
  return paths;
}

inline std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

inline std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace fiducap
