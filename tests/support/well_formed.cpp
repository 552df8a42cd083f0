#include "support/well_formed.hpp"

#include <array>
#include <cctype>
#include <set>
#include <vector>

namespace fiducap::test {
namespace {

bool is_name(std::string_view word) {
  if (word.empty() || std::isalpha(static_cast<unsigned char>(word.front())) == 0) return false;
  for (const char c : word)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != ':' && c != '_')
      return false;
  return true;
}

/// Text between elements, or the value of an attribute.
std::string text_fault(std::string_view text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') return "control character";
    if (c == '<') return "'<' in a text";
    if (c != '&') continue;
    bool known = false;
    for (const std::string_view entity : {"&amp;", "&lt;", "&gt;", "&quot;", "&apos;"})
      known = known || text.substr(i).starts_with(entity);
    if (!known) return "'&' that begins no entity";
  }
  return {};
}

/// ` a="1" b="2"`
std::string attributes_fault(std::string_view rest) {
  std::set<std::string_view> seen;
  for (;;) {
    const auto begin = rest.find_first_not_of(" \n\t");
    if (begin == std::string_view::npos) return {};
    if (begin == 0) return "no blank before an attribute";
    rest.remove_prefix(begin);
    const auto equals = rest.find('=');
    if (equals == std::string_view::npos || !is_name(rest.substr(0, equals)))
      return "no attribute: " + std::string(rest.substr(0, 40));
    if (!seen.insert(rest.substr(0, equals)).second) return "attribute given twice";
    rest.remove_prefix(equals + 1);
    if (!rest.starts_with('"')) return "value without quotes";
    const auto end = rest.find('"', 1);
    if (end == std::string_view::npos) return "value without end";
    if (std::string fault = text_fault(rest.substr(1, end - 1)); !fault.empty()) return fault;
    rest.remove_prefix(end + 1);
  }
}

/// Reads `<…>` and keeps account of what is open.
std::string tag_fault(std::string_view tag, std::vector<std::string>& open, int& roots) {
  if (tag.starts_with('/')) {
    if (open.empty() || open.back() != tag.substr(1)) return "ends what is not open";
    open.pop_back();
    return {};
  }
  const bool is_empty = tag.ends_with('/');
  if (is_empty) tag.remove_suffix(1);
  const std::string_view name = tag.substr(0, tag.find_first_of(" \n\t"));
  if (!is_name(name)) return "no name of an element";
  if (open.empty() && ++roots > 1) return "a second root";
  if (!is_empty) open.emplace_back(name);
  return attributes_fault(tag.substr(name.size()));
}

}  // namespace

std::string xml_fault(std::string_view text) {
  const std::string_view whole = text;
  std::vector<std::string> open;
  int roots = 0;
  if (text.starts_with("<!DOCTYPE html>")) text.remove_prefix(15);
  while (!text.empty()) {
    const auto here = "at byte " + std::to_string(whole.size() - text.size()) + ": ";
    const auto begin = text.find('<');
    const std::string_view between = text.substr(0, begin);
    if (std::string fault = text_fault(between); !fault.empty()) return here + fault;
    if (open.empty() && between.find_first_not_of(" \n\t") != std::string_view::npos)
      return here + "text outside of the root";
    if (begin == std::string_view::npos) break;
    text.remove_prefix(begin + 1);
    const auto end = text.find('>');
    if (end == std::string_view::npos) return here + "'<' without '>'";
    if (std::string fault = tag_fault(text.substr(0, end), open, roots); !fault.empty())
      return here + fault + ": <" + std::string(text.substr(0, 60));
    text.remove_prefix(end + 1);
  }
  if (!open.empty()) return "is not ended: " + open.back();
  return roots == 1 ? "" : "no root";
}

}  // namespace fiducap::test
