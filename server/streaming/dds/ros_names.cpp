#include "streaming/dds/ros_names.hpp"

#include <algorithm>

#include "streaming/conventions/protocol_conventions.hpp"

namespace fiducap::dds {

namespace {

constexpr std::size_t kLongestName = 100;

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string as_ros_name(const std::string& name) {
  std::string out;
  for (const char c : name) {
    const char put = is_letter(c) || is_digit(c) ? c : '_';
    if (put == '_' && !out.empty() && out.back() == '_') continue;
    out += put;
  }
  while (!out.empty() && out.back() == '_') out.pop_back();
  if (out.empty()) return "body";
  if (is_letter(out.front())) return out;
  return (out.front() == '_' ? "body" : "body_") + out;
}

}  // namespace

bool is_ros_name(std::string_view name) {
  return !name.empty() && name.size() <= kLongestName && is_letter(name.front()) &&
         name.find("__") == std::string_view::npos &&
         std::all_of(name.begin(), name.end(),
                     [](char c) { return is_letter(c) || is_digit(c) || c == '_'; });
}

bool is_ros_namespace(std::string_view name) {
  if (name.size() > 150) return false;
  while (!name.empty()) {
    if (name.front() != '/') return false;
    name.remove_prefix(1);
    const std::string_view part = name.substr(0, name.find('/'));
    if (!is_ros_name(part)) return false;
    name.remove_prefix(part.size());
  }
  return true;
}

bool is_ros_frame(std::string_view name) {
  const auto good = [](char c) {
    return is_letter(c) || is_digit(c) || c == '_' || c == '/' || c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= 100 && name.front() != '/' &&
         std::all_of(name.begin(), name.end(), good);
}

std::vector<std::string> ros_names(const SceneModel& model, const NameAliases& aliases) {
  std::vector<std::string> fit;
  for (const BodyDescription& body : model.bodies)
    fit.push_back(as_ros_name(client_name(body.name, conventions_of("ros2").names, aliases)));
  return told_apart(model, aliases, fit, kLongestName);
}

}  // namespace fiducap::dds
