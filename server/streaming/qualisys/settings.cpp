#include "streaming/qualisys/settings.hpp"

#include <array>
#include <optional>
#include <utility>

#include "streaming/qualisys/command.hpp"

namespace fiducap::qualisys {

namespace {

constexpr std::size_t kMaxBodies = 1000;
constexpr std::size_t kMaxDepth = 16;

std::string unescape_xml(std::string_view text) {
  static constexpr std::array<std::pair<std::string_view, char>, 5> kEntities{
      {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&apos;", '\''}}};
  std::string out;
  while (!text.empty()) {
    std::size_t used = 1;
    char c = text.front();
    for (const auto& [entity, meaning] : kEntities) {
      if (!text.starts_with(entity)) continue;
      c = meaning;
      used = entity.size();
    }
    out += c;
    text.remove_prefix(used);
  }
  return out;
}

/// One step through the text: an opening or closing tag and the characters before it.
struct Tag {
  std::string_view before;
  std::string_view name;
  bool opens{false};
  bool closes{false};
};

/// @return nothing at the end; Error when a tag has no end or no name
Expected<std::optional<Tag>> next_tag(std::string_view& rest) {
  const auto begin = rest.find('<');
  if (begin == std::string_view::npos) return std::nullopt;
  const auto end = rest.find('>', begin);
  if (end == std::string_view::npos) return fail(ErrorCode::kTruncated, "a tag has no end");
  Tag tag;
  tag.before = rest.substr(0, begin);
  std::string_view inside = rest.substr(begin + 1, end - begin - 1);
  rest.remove_prefix(end + 1);
  if (inside.starts_with('?') || inside.starts_with('!')) return tag;  // declaration, comment
  tag.closes = inside.starts_with('/') || inside.ends_with('/');
  tag.opens = !inside.starts_with('/');
  if (inside.starts_with('/')) inside.remove_prefix(1);
  tag.name = inside.substr(0, inside.find_first_of(" \t\r\n/"));
  if (tag.name.empty()) return fail(ErrorCode::kInvalid, "a tag has no name");
  return tag;
}

/// Walks through the elements and remembers what stands in Body/Name and Body/Enabled.
class Walk final {
 public:
  Expected<void> take(const Tag& tag) {
    if (tag.opens) {
      if (path_.size() >= kMaxDepth) return fail(ErrorCode::kInvalid, "elements lie too deep");
      path_.push_back(tag.name);
      if (in_body() && path_.back() == "Body") name_.reset(), enabled_.reset();
    }
    if (!tag.closes) return {};
    if (path_.empty() || path_.back() != tag.name) {
      return fail(ErrorCode::kInvalid, "an element is closed that is not open");
    }
    const auto done = leave(tag.opens ? std::string_view{} : tag.before);
    path_.pop_back();
    return done;
  }
  [[nodiscard]] bool whole() const { return path_.empty(); }
  std::vector<BodySwitch> found;

 private:
  [[nodiscard]] bool in_body() const {
    return path_.size() >= 2 && path_[path_.size() - 2] == "The_6D";
  }
  Expected<void> leave(std::string_view text) {
    const bool field = path_.size() >= 3 && path_[path_.size() - 2] == "Body" &&
                       path_[path_.size() - 3] == "The_6D";
    if (field && path_.back() == "Name") name_ = unescape_xml(text);
    if (field && path_.back() == "Enabled") enabled_ = same_word(text, "true");
    if (!in_body() || path_.back() != "Body" || !name_ || !enabled_) return {};
    if (found.size() >= kMaxBodies) return fail(ErrorCode::kInvalid, "too many bodies");
    found.push_back({*name_, *enabled_});
    return {};
  }

  std::vector<std::string_view> path_;
  std::optional<std::string> name_;
  std::optional<bool> enabled_;
};

}  // namespace

Expected<std::vector<BodySwitch>> parse_body_switches(std::string_view xml) {
  Walk walk;
  for (;;) {
    const auto tag = next_tag(xml);
    if (!tag) return tl::unexpected(tag.error());
    if (!*tag) break;
    if ((*tag)->name.empty()) continue;
    if (const auto done = walk.take(**tag); !done) return tl::unexpected(done.error());
  }
  if (!walk.whole()) return fail(ErrorCode::kTruncated, "an element is not closed");
  return std::move(walk.found);
}

}  // namespace fiducap::qualisys
