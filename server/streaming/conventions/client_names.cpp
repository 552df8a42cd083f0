#include "streaming/conventions/client_names.hpp"

#include <algorithm>

namespace fiducap {

namespace {

constexpr unsigned char kFirstPrintable = 0x20;
constexpr unsigned char kDelete = 0x7f;
constexpr unsigned char kContinuationMask = 0xc0;
constexpr unsigned char kContinuation = 0x80;

bool is_fit(char c, const NameRule& rule) {
  const auto byte = static_cast<unsigned char>(c);
  if (byte < kFirstPrintable || byte == kDelete) return false;
  if (byte > kDelete && rule.ascii_only) return false;
  if (c == ' ' && !rule.spaces) return false;
  return rule.forbidden.find(c) == std::string_view::npos;
}

void cut(std::string& name, std::size_t max_bytes) {
  if (name.size() <= max_bytes) return;
  std::size_t end = max_bytes;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & kContinuationMask) == kContinuation)
    --end;
  name.resize(end);
}

}  // namespace

std::string client_name(const std::string& name, const NameRule& rule, const NameAliases& aliases) {
  const auto alias = aliases.find(name);
  std::string out = alias == aliases.end() ? name : alias->second;
  std::replace_if(
      out.begin(), out.end(), [&](char c) { return !is_fit(c, rule); }, '_');
  cut(out, rule.max_bytes);
  return out.empty() ? "_" : out;
}

std::vector<std::string> client_names(const SceneModel& model, const NameRule& rule,
                                      const NameAliases& aliases) {
  std::vector<std::string> names;
  for (const BodyDescription& body : model.bodies) {
    const std::string plain = client_name(body.name, rule, aliases);
    std::string name = plain;
    for (int again = 2; std::find(names.begin(), names.end(), name) != names.end(); ++again) {
      const std::string suffix = "_" + std::to_string(again);
      name = plain;
      cut(name, rule.max_bytes > suffix.size() ? rule.max_bytes - suffix.size() : 0);
      name += suffix;
    }
    names.push_back(std::move(name));
  }
  return names;
}

}  // namespace fiducap
