#include "streaming/qualisys/command.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace fiducap::qualisys {

namespace {

constexpr std::string_view kSpaces = " \t\r\n";
constexpr std::uint32_t kMaxNumber = 100'000;  // Hz, or frames to the next one

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(kSpaces);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpaces) - begin + 1);
}

template <class Number>
std::optional<Number> number_of(std::string_view text) {
  Number n{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return n;
}

Expected<Rate> parse_rate(std::string_view word) {
  if (same_word(word, "AllFrames")) return Rate{};
  const auto colon = word.find(':');
  const std::string_view kind = word.substr(0, colon);
  const auto n = colon == std::string_view::npos ? std::nullopt
                                                 : number_of<std::uint32_t>(word.substr(colon + 1));
  if (n && *n >= 1 && *n <= kMaxNumber) {
    if (same_word(kind, "Frequency")) return Rate{RateKind::kFrequency, *n};
    if (same_word(kind, "FrequencyDivisor")) return Rate{RateKind::kFrequencyDivisor, *n};
  }
  return fail(
      ErrorCode::kInvalid,
      "expected AllFrames, Frequency:n or FrequencyDivisor:n, came \"" + std::string(word) + "\"");
}

/// `UDP:port` or `UDP:address:port`.
Expected<void> parse_udp(std::string_view word, StreamRequest& request) {
  const std::string_view target = word.substr(word.find(':') + 1);
  const auto colon = target.rfind(':');
  const std::string_view port = colon == std::string_view::npos ? target : target.substr(colon + 1);
  const auto number = number_of<std::uint16_t>(port);
  if (!number || *number < kLowestUdpPort) {
    return fail(ErrorCode::kInvalid,
                "expected a UDP port from 1024, came \"" + std::string(port) + "\"");
  }
  request.udp_port = *number;
  if (colon != std::string_view::npos) request.udp_address = target.substr(0, colon);
  return {};
}

bool begins_with_word(std::string_view text, std::string_view word) {
  return text.size() >= word.size() && same_word(text.substr(0, word.size()), word);
}

}  // namespace

bool same_word(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](char x, char y) { return lower(x) == lower(y); });
}

bool Command::is(std::string_view word) const { return same_word(name, word); }

Command split_command(std::string_view text) {
  const std::string_view line = trimmed(text);
  const auto end = std::min(line.find_first_of(kSpaces), line.size());
  return {line.substr(0, end), trimmed(line.substr(end))};
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  for (;;) {
    const Command next = split_command(text);
    if (next.name.empty()) return words;
    words.push_back(next.name);
    text = next.rest;
  }
}

Expected<Components> parse_components(std::string_view words) {
  Components components;
  for (const std::string_view word : words_of(words)) {
    if (same_word(word, "All")) return Components::all();
    const std::string_view plain = word.substr(0, word.find(':'));  // options: Skeleton:global
    for (const auto& known : kComponentWords) {
      if (same_word(plain, known.word)) components.add(known.component);
    }
  }
  if (components.empty()) {
    return fail(ErrorCode::kInvalid,
                "expected components, e.g. 6D, came \"" + std::string(words) + "\"");
  }
  return components;
}

Expected<StreamRequest> parse_stream_request(std::string_view words) {
  StreamRequest request;
  const Command first = split_command(words);
  const auto rate = parse_rate(first.name);
  if (!rate) return tl::unexpected(rate.error());
  request.rate = *rate;
  std::string_view rest = first.rest;
  const Command second = split_command(rest);
  if (begins_with_word(second.name, "UDP:")) {
    if (const auto done = parse_udp(second.name, request); !done) {
      return tl::unexpected(done.error());
    }
    rest = second.rest;
  }
  const auto components = parse_components(rest);
  if (!components) return tl::unexpected(components.error());
  request.components = *components;
  return request;
}

std::optional<Version> parse_version(std::string_view word) {
  if (!word.starts_with("1.")) return std::nullopt;
  const auto minor = number_of<int>(word.substr(2));
  if (!minor || *minor < 0 || *minor > Version::kNewest) return std::nullopt;
  return Version{*minor};
}

Expected<ParameterGroups> parse_parameter_groups(std::string_view words) {
  static constexpr std::array<std::string_view, 8> kOthers{
      "Analog", "Force", "Image", "GazeVector", "EyeTracker", "Skeleton", "Calibration", "2D"};
  ParameterGroups groups;
  for (const std::string_view word : words_of(words)) {
    const std::string_view plain = word.substr(0, word.find(':'));
    const bool all = same_word(plain, "All");
    groups.general = groups.general || all || same_word(plain, "General");
    groups.three_d = groups.three_d || all || same_word(plain, "3D");
    groups.six_d = groups.six_d || all || same_word(plain, "6D");
    groups.others = groups.others || std::any_of(kOthers.begin(), kOthers.end(), [&](auto known) {
                      return same_word(plain, known);
                    });
  }
  if (groups.any()) return groups;
  return fail(ErrorCode::kInvalid,
              "expected General, 3D, 6D … or All, came \"" + std::string(words) + "\"");
}

}  // namespace fiducap::qualisys
