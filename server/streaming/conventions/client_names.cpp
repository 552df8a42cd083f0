#include "streaming/conventions/client_names.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/text.hpp"
#include "streaming/conventions/text_fields.hpp"

namespace fiducap {

namespace {

// One word for each character of a block, in order; ? for what is not a letter.
// Latin-1 Supplement and Latin Extended-A, U+00C0 on: German umlauts, Danish and French ligatures
// as usual in their languages, all others without their marks.
constexpr std::string_view kLatin =
    "A A A A Ae Aa Ae C E E E E I I I I D N O O O O Oe x Oe U U U Ue Y Th ss a a a a ae "
    "aa ae c e e e e i i i i d n o o o o oe _ oe u u u ue y th y A a A a A a C c C c C c "
    "C c D d D d E e E e E e E e E e G g G g G g G g H h H h I i I i I i I i I i Ij ij J "
    "j K k k L l L l L l L l L l N n N n N n n Ng ng O o O o O o Oe oe R r R r R r S s S "
    "s S s S s T t T t T t U u U u U u U u U u U u W w Y y Y Z z Z z Z z s ";
// Marked letters of Latin Extended-B (Romanian, Pinyin among them), U+01CD on.
constexpr std::string_view kLatinMarked =
    "A a I i O o U u U u U u U u U u ? A a A a ? ? ? ? G g K k O o O o ? ? j ? ? ? G g ? "
    "? N n A a ? ? ? ? A a A a E e E e I i I i O o O o R r R r U u U u S s T t ? ? H h ? "
    "? ? ? ? ? A a E e O o O o O o O o Y y ";
// Greek, U+0386 on.
constexpr std::string_view kGreek =
    "A ? E I I ? O ? Y O i A V G D E Z I Th I K L M N X O P R ? S T Y F Ch Ps O I Y a e "
    "i i y a v g d e z i th i k l m n x o p r s s t y f ch ps o i y o y o ";
// Cyrillic, U+0400 on.
constexpr std::string_view kCyrillic =
    "E Yo Dj G Ye Dz I Yi J Lj Nj C K I W Dzh A B V G D E Zh Z I J K L M N O P R S T U F "
    "Kh C Ch Sh Shch Q Y Q E Yu Ya a b v g d e zh z i j k l m n o p r s t u f kh c ch sh "
    "shch q y q e yu ya e yo dj g ye dz i yi j lj nj c k i w dzh ";
// Latin Extended Additional (Vietnamese among them), U+1E00 on.
constexpr std::string_view kLatinAdditional =
    "A a B b B b B b C c D d D d D d D d D d E e E e E e E e E e F f G g H h H h H h H h "
    "H h I i I i K k K k K k L l L l L l L l M m M m M m N n N n N n N n O o O o O o O o "
    "P p P p R r R r R r R r S s S s S s S s S s T t T t T t T t U u U u U u U u U u V v "
    "V v W w W w W w W w W w X x X x Y y Z z Z z Z z h t w y a ? s s Ss d A a A a A a A "
    "a A a A a A a A a A a A a A a A a E e E e E e E e E e E e E e E e I i I i O o O o O "
    "o O o O o O o O o O o O o O o O o O o U u U u U u U u U u U u U u Y y Y y Y y Y y "
    "Ll ll V v Y y ";

struct Block {
  char32_t first;
  std::string_view words;
};
constexpr std::array<Block, 5> kBlocks{{{0xc0, kLatin},
                                        {0x1cd, kLatinMarked},
                                        {0x386, kGreek},
                                        {0x400, kCyrillic},
                                        {0x1e00, kLatinAdditional}}};

/// @return the word at this place; empty: there are fewer
std::string_view word_at(std::string_view words, char32_t place) {
  for (; place > 0; --place) {
    const auto blank = words.find(' ');
    if (blank == std::string_view::npos) return {};
    words.remove_prefix(blank + 1);
  }
  return words.substr(0, words.find(' '));
}

constexpr char32_t kFirstPrintable = 0x20;
constexpr char32_t kDelete = 0x7f;

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

bool has(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// Ends in `_2`, `_3`, … where the plain name is taken.
std::string distinct(const std::string& plain, const std::vector<std::string>& taken,
                     std::size_t max_bytes) {
  std::string name = plain;
  for (int again = 2; has(taken, name); ++again) {
    const std::string suffix = "_" + std::to_string(again);
    name = whole_characters(plain, max_bytes > suffix.size() ? max_bytes - suffix.size() : 0);
    name += suffix;
  }
  return name;
}

std::string wanted_name(const std::string& name, const NameAliases& aliases) {
  const auto alias = aliases.find(name);
  return alias == aliases.end() ? name : alias->second;
}

}  // namespace

std::string ascii_of(char32_t c) {
  for (const Block& block : kBlocks) {
    if (c < block.first) continue;
    const std::string_view word = word_at(block.words, c - block.first);
    if (!word.empty() && word != "?") return std::string(word);
  }
  return fmt::format("u{:04x}", static_cast<unsigned>(c));
}

std::string client_name(const std::string& name, const NameRule& rule, const NameAliases& aliases) {
  const std::string fit = fitted(wanted_name(name, aliases), rule);
  const std::string_view out = whole_characters(fit, rule.max_bytes);
  return out.empty() ? "_" : std::string(out);
}

std::vector<std::string> make_distinct(const SceneModel& model, const NameAliases& aliases,
                                       const std::vector<std::string>& fit, std::size_t max_bytes) {
  std::vector<std::string> names(fit.size());
  for (std::size_t i = 0; i < fit.size(); ++i) {
    const bool as_it_is = fit[i] == wanted_name(model.bodies[i].name, aliases);
    if (as_it_is && !has(names, fit[i])) names[i] = fit[i];
  }
  for (std::size_t i = 0; i < fit.size(); ++i)
    if (names[i].empty()) names[i] = distinct(fit[i], names, max_bytes);
  return names;
}

std::vector<std::string> client_names(const SceneModel& model, const NameRule& rule,
                                      const NameAliases& aliases) {
  std::vector<std::string> fit;
  for (const BodyDescription& body : model.bodies)
    fit.push_back(client_name(body.name, rule, aliases));
  return make_distinct(model, aliases, fit, rule.max_bytes);
}

}  // namespace fiducap
