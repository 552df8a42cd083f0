#include "tools/wrong_words.hpp"

#include <algorithm>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/closest_word.hpp"

namespace fiducap {
namespace {

std::vector<std::string> verbs_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands({})) names.push_back(verb->get_name());
  return names;
}

/// `--out` and so on; those of one letter are not guessed at.
std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options({}))
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

std::string not_a_verb(const std::string& said, const std::string& word,
                       const std::vector<std::string>& verbs) {
  return said + " " + word + ": there is no such verb; it " + must_be_one_of(verbs, word);
}

std::string not_an_option(const std::string& said, const std::string& word,
                          const std::vector<std::string>& options) {
  const std::string meant = did_you_mean(word, options);
  return said + " " + word + ": there is no such option; " +
         (meant.empty() ? "`" + said + " --help` lists them" : meant);
}

}  // namespace

std::optional<std::string> wrong_word(const CLI::App& app, int argc, const char* const* argv) {
  const CLI::App* at = &app;
  std::string said = app.get_name();
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto verbs = verbs_of(*at);
    if (word == "--") return std::nullopt;  // what follows is no option, whatever it looks like
    if (word.starts_with("--")) {
      const auto options = options_of(*at);
      const std::string name = word.substr(0, word.find('='));
      if (std::find(options.begin(), options.end(), name) == options.end())
        return not_an_option(said, name, options);
      continue;
    }
    if (word.empty() || word.front() == '-' || verbs.empty()) continue;
    if (std::find(verbs.begin(), verbs.end(), word) == verbs.end())
      return not_a_verb(said, word, verbs);
    at = at->get_subcommand(word);
    said += " " + word;
  }
  return std::nullopt;
}

}  // namespace fiducap
