// Words that are not used (docs/words.md): none in what users read, few in comments, none in names.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "architecture/source_files.hpp"

namespace fiducap::test {
namespace {

constexpr double kMostCommentLines = 0.005;
const std::string kRoot = FIDUCAP_SOURCE_DIR;

using Words = std::vector<std::string>;

/// Lower case, without punctuation; options (`--option`) are names, not words.
Words words_of(std::string_view text) {
  Words words;
  std::string word;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    if (text.substr(i).starts_with("--")) i = std::min(text.find_first_of(" ,)", i), text.size());
    const char c = i < text.size() ? text[i] : ' ';
    if (std::isalpha(static_cast<unsigned char>(c))) {
      word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else if (!word.empty()) {
      words.push_back(std::exchange(word, {}));
    }
  }
  return words;
}

/// One entry of the table: a word or several; `*` means any ending.
struct Banned {
  Words words;
  bool any_ending{};
};

struct BannedWords {
  std::map<std::string, std::vector<Banned>> in_text;  ///< By its beginning.
  std::vector<Banned> with_any_ending;                 ///< Single words.
  std::set<std::string> in_names;
};

BannedWords read_banned_words() {
  BannedWords banned;
  enum { kNone, kText, kNames } table = kNone;
  for (const std::string& line : lines_of("docs/words.md")) {
    if (line.starts_with("| not | but")) table = kText;
    if (line.starts_with("| not in names")) table = kNames;
    if (table == kNone || !line.starts_with("| ") || line.starts_with("| not ")) continue;
    std::string entry;
    for (const char c : line.substr(2, line.find('|', 2) - 2) + ",") {
      if (c != ',') {
        entry += c;
        continue;
      }
      Banned one{words_of(entry), entry.find('*') != std::string::npos};
      entry.clear();
      if (one.words.empty()) continue;
      if (table == kNames) {
        banned.in_names.insert(one.words.front());
      } else if (one.any_ending) {
        banned.with_any_ending.push_back(one);
      } else {
        banned.in_text[one.words.front()].push_back(one);
      }
    }
  }
  EXPECT_GT(banned.in_text.size(), 50u);
  EXPECT_GT(banned.in_names.size(), 20u);
  return banned;
}

const BannedWords& banned_words() {
  static const BannedWords words = read_banned_words();
  return words;
}

/// "A user who …" and "stands still" are plain.
bool is_plain(const Words& words, std::size_t i) {
  static const std::set<std::string> kPeople{"user",     "users",     "person", "people",
                                             "operator", "operators", "reader", "readers"};
  if (words[i] == "who") return i > 0 && kPeople.contains(words[i - 1]);
  if (words[i] == "stands" || words[i] == "stood") {
    return i + 1 < words.size() && words[i + 1] == "still";
  }
  return false;
}

/// The first banned word or phrase; empty: none.
std::string first_banned(std::string_view text) {
  const Words words = words_of(text);
  for (std::size_t i = 0; i < words.size(); ++i) {
    for (const Banned& banned : banned_words().with_any_ending) {
      if (words[i].starts_with(banned.words.front())) return words[i];
    }
    const auto found = banned_words().in_text.find(words[i]);
    if (found == banned_words().in_text.end() || is_plain(words, i)) continue;
    for (const Banned& banned : found->second) {
      if (banned.words.size() > words.size() - i) continue;
      const auto here = words.begin() + static_cast<std::ptrdiff_t>(i);
      if (std::equal(banned.words.begin(), banned.words.end(), here)) return words[i];
    }
  }
  return "";
}

/// Where the comment begins; npos: there is none. A `//` after a colon or quote is an address.
std::size_t comment_begin(const std::string& line) {
  for (std::size_t at = line.find("//"); at != std::string::npos; at = line.find("//", at + 2)) {
    if (at == 0 || (line[at - 1] != ':' && line[at - 1] != '"')) return at;
  }
  return std::string::npos;
}

/// The string literals of a line of code that are sentences.
std::vector<std::string> sentences_of(const std::string& code) {
  std::vector<std::string> sentences;
  bool inside = false;
  std::string text;
  for (std::size_t i = 0; i < code.size(); ++i) {
    if (inside && code[i] == '\\') {
      ++i;
    } else if (code[i] == '"') {
      if (inside && text.find(' ') != std::string::npos) sentences.push_back(text);
      text.clear();
      inside = !inside;
    } else if (inside) {
      text += code[i];
    }
  }
  return sentences;
}

/// `take`, `time` of `take_time` and `TakeTime`.
Words parts_of_name(const std::string& name) {
  std::string spaced;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const auto c = static_cast<unsigned char>(name[i]);
    if (i > 0 && std::isupper(c) && std::islower(static_cast<unsigned char>(name[i - 1]))) {
      spaced += ' ';
    }
    spaced += name[i];
  }
  return words_of(spaced);
}

TEST(Words, OfTheListAreRareInComments) {
  std::size_t lines = 0;
  std::vector<std::string> found;
  for (const SourceFile& file : source_files({"server", "client"})) {
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      const std::size_t begin = comment_begin(file.lines[i]);
      if (begin == std::string::npos) continue;
      ++lines;
      const std::string word = first_banned(std::string_view(file.lines[i]).substr(begin));
      if (!word.empty()) found.push_back(file.place(i) + ": " + word);
    }
  }
  EXPECT_GT(lines, 5000u);
  const auto most = static_cast<std::size_t>(kMostCommentLines * static_cast<double>(lines));
  EXPECT_LE(found.size(), most) << "of " << lines << " lines: " << ::testing::PrintToString(found);
}

TEST(Words, OfTheListAreInNoMessageAndNoName) {
  for (const SourceFile& file : source_files({"server", "client"})) {
    for (std::size_t i = 0; i < file.lines.size(); ++i) {
      for (const std::string& text : sentences_of(file.lines[i]))
        EXPECT_EQ(first_banned(text), "") << file.place(i) << ": " << text;
      std::string name;
      bool inside = false;
      for (const char c : file.lines[i].substr(0, comment_begin(file.lines[i])) + " ") {
        if (c == '"') inside = !inside;
        if (!inside && (std::isalnum(static_cast<unsigned char>(c)) || c == '_')) {
          name += c;
          continue;
        }
        for (const std::string& part : parts_of_name(std::exchange(name, {})))
          EXPECT_FALSE(banned_words().in_names.contains(part)) << file.place(i) << ": " << part;
      }
    }
  }
}

TEST(Words, OfTheListAreInNoDocument) {
  namespace fs = std::filesystem;
  std::vector<fs::path> documents{"README.md", "ARCHITECTURE.md", "CONTRIBUTING.md",
                                  "CHANGELOG.md"};
  for (const char* folder : {"/docs", "/server", "/client", "/config", "/tests"}) {
    for (const auto& entry : fs::recursive_directory_iterator(kRoot + folder)) {
      const fs::path& path = entry.path();
      if (path.extension() == ".md" && path.filename() != "words.md") documents.push_back(path);
    }
  }
  EXPECT_GT(documents.size(), 30u);
  for (const fs::path& path : documents) {
    int number = 0;
    bool code = false;
    for (const std::string& line : lines_of(path)) {
      ++number;
      if (line.starts_with("```")) code = !code;
      // Text in backquotes is a name: of a test, a key or a command.
      std::string text;
      bool quoted = code;
      for (const char c : line) {
        if (c == '`' && !code) quoted = !quoted;
        if (!quoted) text += c;
      }
      EXPECT_EQ(first_banned(text), "") << path << ":" << number << ": " << line;
    }
  }
}

}  // namespace
}  // namespace fiducap::test
