#include "streaming/natnet/command.hpp"

namespace fiducap::natnet {

namespace {

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

}  // namespace

Command parse_command(std::string_view text) {
  Command command;
  auto comma = text.find(',');
  command.word = trimmed(text.substr(0, comma));
  while (comma != std::string_view::npos && command.count < Command::kMostArguments) {
    text.remove_prefix(comma + 1);
    comma = command.count + 1 < Command::kMostArguments ? text.find(',') : std::string_view::npos;
    command.arguments[command.count++] = trimmed(text.substr(0, comma));
  }
  return command;
}

}  // namespace fiducap::natnet
