#pragma once

#include <string>
#include <vector>

#include "base/time.hpp"
#include "base/yaml_values.hpp"

namespace fiducap {

/// The visitor that writes structs as YAML.
class ConfigPrinter final {
 public:
  template <typename T>
  void value(const char* key, const T& x) {
    line(key, text_of(x));
  }
  template <typename E, std::size_t N>
  void word(const char* key, const E& x, const std::array<words::Word<E>, N>& vocabulary) {
    line(key, text_of_word<E>(vocabulary, x));
  }
  void seconds(const char* key, const Duration& x) { line(key, text_of(to_seconds(x))); }
  void path(const char* key, const std::string& x) { line(key, text_of(x)); }
  /// Never shown: who reads the print, or a recording with it, shall not get in.
  void secret(const char* key, const std::string& x) {
    line(key, x.empty() ? "\"\"" : "\"\"  # set, not shown");
  }
  void device(const char* key, const std::string& x) { line(key, text_of(x)); }

  template <typename T>
  void section(const char* key, T& x) {
    line(key, "");
    indent_ += kStep;
    describe(*this, x);
    indent_ -= kStep;
  }
  template <typename T>
  void optional_section(const char* key, std::optional<T>& x) {
    if (x) return section(key, *x);
    line(key, "null");
  }
  template <typename T>
  void list(const char* key, std::vector<T>& items) {
    if (items.empty()) return line(key, "[]");
    line(key, "");
    indent_ += 2 * kStep;
    for (auto& item : items) {
      at_dash_ = true;
      describe(*this, item);
    }
    indent_ -= 2 * kStep;
  }

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static constexpr std::size_t kStep = 2;

  void line(const std::string& key, const std::string& value) {
    text_ += at_dash_ ? std::string(indent_ - kStep, ' ') + "- " : std::string(indent_, ' ');
    text_ += key + (value.empty() ? ":" : ": " + value) + "\n";
    at_dash_ = false;
  }

  std::string text_;
  std::size_t indent_{0};
  bool at_dash_{false};
};

}  // namespace fiducap
