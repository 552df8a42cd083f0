#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace fiducap {

/// How a control of a camera shall stand.
struct ControlWish {
  enum class Kind { kAsIs, kAuto, kOff, kOn, kNumber };
  Kind kind{Kind::kAsIs};  ///< kAsIs: it is not touched.
  std::int32_t number{};

  bool operator==(const ControlWish&) const = default;
};

/// `as_is`, `auto`, `off`, `on` or a whole number; nullopt: none of them.
[[nodiscard]] std::optional<ControlWish> control_wish(std::string_view text);

}  // namespace fiducap
