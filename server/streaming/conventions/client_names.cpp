#include "streaming/conventions/client_names.hpp"

#include <algorithm>
#include <string_view>

#include "base/utf8.hpp"
#include "streaming/conventions/transliteration.hpp"

namespace fiducap {

namespace {

constexpr char32_t kFirstPrintable = 0x20;
constexpr char32_t kDelete = 0x7f;
constexpr unsigned char kContinuationMask = 0xc0;
constexpr unsigned char kContinuation = 0x80;

bool is_fit(char32_t c, const NameRule& rule) {
  if (c < kFirstPrintable || c == kDelete) return false;
  if (c > kDelete) return !rule.ascii_only;
  if (c == ' ' && !rule.spaces) return false;
  return rule.forbidden.find(static_cast<char>(c)) == std::string_view::npos;
}

std::string fitted(std::string_view name, const NameRule& rule) {
  std::string out;
  while (!name.empty()) {
    const std::string_view before = name;
    const auto c = take_character(name);
    if (c && is_fit(*c, rule)) {
      out += before.substr(0, before.size() - name.size());
    } else {
      out += c && *c > kDelete ? ascii_of(*c) : "_";
    }
  }
  return out;
}

void cut(std::string& name, std::size_t max_bytes) {
  if (name.size() <= max_bytes) return;
  std::size_t end = max_bytes;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & kContinuationMask) == kContinuation)
    --end;
  name.resize(end);
}

bool has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Ends in `_2`, `_3`, … where the plain name is taken.
std::string distinct(const std::string& plain, const std::vector<std::string>& taken,
                     std::size_t max_bytes) {
  std::string name = plain;
  for (int again = 2; has(taken, name); ++again) {
    const std::string suffix = "_" + std::to_string(again);
    name = plain;
    cut(name, max_bytes > suffix.size() ? max_bytes - suffix.size() : 0);
    name += suffix;
  }
  return name;
}

std::string wanted_name(const std::string& name, const NameAliases& aliases) {
  const auto alias = aliases.find(name);
  return alias == aliases.end() ? name : alias->second;
}

}  // namespace

std::string client_name(const std::string& name, const NameRule& rule, const NameAliases& aliases) {
  std::string out = fitted(wanted_name(name, aliases), rule);
  cut(out, rule.max_bytes);
  return out.empty() ? "_" : out;
}

std::vector<std::string> told_apart(const SceneModel& model, const NameAliases& aliases,
                                    const std::vector<std::string>& fit, std::size_t max_bytes) {
  std::vector<std::string> names(fit.size());
  for (std::size_t i = 0; i < fit.size(); ++i) {
    const bool as_it_is = fit[i] == wanted_name(model.bodies[i].name, aliases);
    if (as_it_is && !has(names, fit[i])) names[i] = fit[i];
  }
  for (std::size_t i = 0; i < fit.size(); ++i) {
    if (names[i].empty()) names[i] = distinct(fit[i], names, max_bytes);
  }
  return names;
}

std::vector<std::string> client_names(const SceneModel& model, const NameRule& rule,
                                      const NameAliases& aliases) {
  std::vector<std::string> fit;
  for (const BodyDescription& body : model.bodies)
    fit.push_back(client_name(body.name, rule, aliases));
  return told_apart(model, aliases, fit, rule.max_bytes);
}

}  // namespace fiducap
