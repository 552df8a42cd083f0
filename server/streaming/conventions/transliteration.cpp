#include "streaming/conventions/transliteration.hpp"

#include <array>

#include <fmt/format.h>

namespace fiducap {

namespace {

// One word for each character from the first of its block on; ? for what is none of its letters.
// Latin-1 Supplement and Latin Extended-A, U+00C0 on: German umlauts, Danish and French ligatures
// as their languages write them, all others without their marks.
constexpr std::string_view kLatin =
    "A A A A Ae Aa Ae C E E E E I I I I D N O O O O Oe x Oe U U U Ue Y Th ss a a a a ae "
    "aa ae c e e e e i i i i d n o o o o oe _ oe u u u ue y th y A a A a A a C c C c C c "
    "C c D d D d E e E e E e E e E e G g G g G g G g H h H h I i I i I i I i I i Ij ij J "
    "j K k k L l L l L l L l L l N n N n N n n Ng ng O o O o O o Oe oe R r R r R r S s S "
    "s S s S s T t T t T t U u U u U u U u U u U u W w Y y Y Z z Z z Z z s ";
// Of Latin Extended-B what has a mark (Romanian, Pinyin among them), U+01CD on.
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

}  // namespace

std::string ascii_of(char32_t c) {
  for (const Block& block : kBlocks) {
    if (c < block.first) continue;
    const std::string_view word = word_at(block.words, c - block.first);
    if (!word.empty() && word != "?") return std::string(word);
  }
  return fmt::format("u{:04x}", static_cast<unsigned>(c));
}

}  // namespace fiducap
