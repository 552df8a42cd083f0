#include "capture/control_wish.hpp"

#include <charconv>

namespace fiducap {

std::optional<ControlWish> control_wish(std::string_view text) {
  using Kind = ControlWish::Kind;
  if (text == "as_is") return ControlWish{Kind::kAsIs};
  if (text == "auto") return ControlWish{Kind::kAuto};
  if (text == "off") return ControlWish{Kind::kOff};
  if (text == "on") return ControlWish{Kind::kOn};
  ControlWish wish{Kind::kNumber};
  const char* end = text.data() + text.size();
  const auto read = std::from_chars(text.data(), end, wish.number);
  if (read.ec != std::errc() || read.ptr != end) return std::nullopt;
  return wish;
}

}  // namespace fiducap
