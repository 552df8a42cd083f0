#include "capture/v4l2/control.hpp"

#include <algorithm>
#include <cctype>

#include <linux/videodev2.h>

namespace fiducap::v4l2 {
namespace {

constexpr std::size_t kMostControls = 256;
constexpr std::int32_t kMostChoices = 64;

std::string name_in(const std::uint8_t* bytes, std::size_t size) {
  std::string name;
  for (std::size_t i = 0; i < size && bytes[i] != 0; ++i)
    name += bytes[i] >= ' ' && bytes[i] <= '~' ? static_cast<char>(bytes[i]) : '?';
  return name;
}

std::string in_lower_case(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

bool is_one_number(std::uint32_t type) {
  return type == V4L2_CTRL_TYPE_INTEGER || type == V4L2_CTRL_TYPE_BOOLEAN ||
         type == V4L2_CTRL_TYPE_MENU || type == V4L2_CTRL_TYPE_INTEGER_MENU;
}

std::vector<std::pair<std::int32_t, std::string>> choices_of(Port& port,
                                                             const v4l2_queryctrl& said) {
  std::vector<std::pair<std::int32_t, std::string>> choices;
  const std::int32_t first = std::max(said.minimum, 0);
  for (std::int32_t i = first; i <= std::min(said.maximum, first + kMostChoices); ++i) {
    v4l2_querymenu entry{};
    entry.id = said.id;
    entry.index = static_cast<std::uint32_t>(i);
    if (port.control(VIDIOC_QUERYMENU, &entry) != 0) continue;  // menus have holes
    choices.emplace_back(i, said.type == V4L2_CTRL_TYPE_MENU
                                ? name_in(entry.name, sizeof entry.name)
                                : std::to_string(entry.value));
  }
  return choices;
}

/// nullopt: not one number, or not there.
std::optional<Control> described(Port& port, const v4l2_queryctrl& said) {
  if (!is_one_number(said.type) || (said.flags & V4L2_CTRL_FLAG_DISABLED) != 0) return std::nullopt;
  Control control;
  control.id = said.id;
  control.name = name_in(said.name, sizeof said.name);
  control.minimum = said.minimum;
  control.maximum = said.maximum;
  control.step = said.step;
  control.usual = said.default_value;
  control.may_be_set = (said.flags & (V4L2_CTRL_FLAG_READ_ONLY | V4L2_CTRL_FLAG_INACTIVE)) == 0;
  control.is_yes_or_no = said.type == V4L2_CTRL_TYPE_BOOLEAN;
  if (said.type == V4L2_CTRL_TYPE_MENU || said.type == V4L2_CTRL_TYPE_INTEGER_MENU)
    control.choices = choices_of(port, said);
  if ((said.flags & V4L2_CTRL_FLAG_WRITE_ONLY) == 0) control.value = read_control(port, said.id);
  return control;
}

}  // namespace

bool Control::offers(std::int32_t wanted) const {
  if (choices.empty()) return wanted >= minimum && wanted <= maximum;
  return std::any_of(choices.begin(), choices.end(),
                     [wanted](const auto& choice) { return choice.first == wanted; });
}

std::vector<Control> controls(Port& port) {
  std::vector<Control> found;
  v4l2_queryctrl said{};
  std::uint32_t last = 0;
  for (std::size_t i = 0; i < kMostControls; ++i) {
    said = {};
    said.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (port.control(VIDIOC_QUERYCTRL, &said) != 0 || said.id <= last) break;
    last = said.id;
    if (auto control = described(port, said)) found.push_back(std::move(*control));
  }
  return found;
}

std::optional<Control> control_of(Port& port, std::uint32_t id) {
  v4l2_queryctrl said{};
  said.id = id;
  if (port.control(VIDIOC_QUERYCTRL, &said) != 0) return std::nullopt;
  return described(port, said);
}

std::optional<Control> control_named(Port& port, std::string_view part) {
  for (Control& control : controls(port))
    if (in_lower_case(control.name).find(part) != std::string::npos) return std::move(control);
  return std::nullopt;
}

std::optional<std::int32_t> read_control(Port& port, std::uint32_t id) {
  v4l2_control entry{id, 0};
  if (port.control(VIDIOC_G_CTRL, &entry) != 0) return std::nullopt;
  return entry.value;
}

std::optional<std::int32_t> set_control(Port& port, std::uint32_t id, std::int32_t value) {
  v4l2_control entry{id, value};
  if (port.control(VIDIOC_S_CTRL, &entry) != 0) return std::nullopt;
  return read_control(port, id);
}

}  // namespace fiducap::v4l2
