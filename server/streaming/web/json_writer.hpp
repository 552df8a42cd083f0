#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>

namespace fiducap::web {

/// Writes JSON straight into a string, in the order of the calls. A value of nlohmann-json
/// allocates while it is destroyed, which ends the process when memory is out; here that is an
/// exception like any other.
class JsonWriter final {
 public:
  /// @param fill  what writes the members: member(…)
  template <std::invocable Fill>
  void object(Fill&& fill) {
    enclose('{', fill, '}');
  }
  /// @param fill  what writes the elements: value(…), object(…), array(…)
  template <std::invocable Fill>
  void array(Fill&& fill) {
    enclose('[', fill, ']');
  }
  /// For a value that is an object or an array: its name, then the value.
  void name(std::string_view name);
  template <class Value>
  void member(std::string_view name, const Value& value) {
    this->name(name);
    this->value(value);
  }

  void value(std::nullptr_t);
  void value(bool truth);
  /// Shortest text that reads as the same number; null when it is not finite.
  void value(double number);
  template <std::integral Number>
  requires(!std::same_as<Number, bool>) void value(Number number) {
    begin_value();
    out_ += std::to_string(number);
  }
  /// Bytes that are not UTF-8 (a body's name, a peer's text) become U+FFFD.
  void value(std::string_view text);
  void value(const char* text) { value(std::string_view(text)); }
  void value(const std::string& text) { value(std::string_view(text)); }

  [[nodiscard]] std::string take() { return std::move(out_); }

 private:
  template <class Fill>
  void enclose(char open, Fill& fill, char close) {
    begin_value();
    out_ += open;
    needs_comma_ = false;
    fill();
    out_ += close;
    needs_comma_ = true;
  }
  void begin_value();

  std::string out_;
  bool needs_comma_{false};
};

}  // namespace fiducap::web
