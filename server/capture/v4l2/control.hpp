#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "capture/v4l2/v4l2_port.hpp"

namespace fiducap::v4l2 {

/// Something that can be set on a device: exposure, gain, …
struct Control {
  std::uint32_t id{};
  std::string name{};
  std::int32_t minimum{};
  std::int32_t maximum{};
  std::int32_t step{1};
  std::int32_t usual{};                 ///< As the driver starts.
  std::optional<std::int32_t> value{};  ///< nullopt: cannot be read.
  bool may_be_set{};                    ///< False also while something automatic rules it.
  bool is_yes_or_no{};
  std::vector<std::pair<std::int32_t, std::string>> choices{};  ///< Of a menu.

  [[nodiscard]] bool offers(std::int32_t wanted) const;
};

/// All numbers, menus and switches; bounded, whatever the device says.
[[nodiscard]] std::vector<Control> controls(Port& port);
[[nodiscard]] std::optional<Control> control_of(Port& port, std::uint32_t id);
/// The first whose name has `part` in it, in any case of letters.
[[nodiscard]] std::optional<Control> control_named(Port& port, std::string_view part);

[[nodiscard]] std::optional<std::int32_t> read_control(Port& port, std::uint32_t id);
/// @return what the device has then; nullopt: it refused, or cannot be read
std::optional<std::int32_t> set_control(Port& port, std::uint32_t id, std::int32_t value);

}  // namespace fiducap::v4l2
