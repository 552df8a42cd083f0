#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "streaming/qualisys/protocol.hpp"

/// What clients say, taken apart. Pure.
namespace fiducap::qualisys {

/// A command's words; more than one space between them is usual (older SDKs).
struct Command {
  std::string_view name;                               ///< First word.
  std::string_view rest;                               ///< All that follows, without spaces around.
  [[nodiscard]] bool is(std::string_view word) const;  ///< Upper and lower case are the same.
};

[[nodiscard]] Command split_command(std::string_view text);
[[nodiscard]] bool same_word(std::string_view a, std::string_view b);
[[nodiscard]] std::vector<std::string_view> words_of(std::string_view text);

enum class RateKind { kAllFrames, kFrequency, kFrequencyDivisor };

/// Which of the published frames one client wants.
struct Rate {
  RateKind kind{RateKind::kAllFrames};
  std::uint32_t n{1};  ///< Hz, or every n-th frame.
  friend bool operator==(const Rate&, const Rate&) = default;
};

/// `StreamFrames …` but Stop.
struct StreamRequest {
  Rate rate;
  std::optional<std::uint16_t> udp_port;  ///< Nothing: by TCP.
  std::string udp_address;                ///< Empty: where the command came from.
  Components components;
};

/// @param words  after `StreamFrames`
/// @return Error when there is no rate, no known component, or a number that cannot be.
[[nodiscard]] Expected<StreamRequest> parse_stream_request(std::string_view words);
/// @return Error when no word names a component.
[[nodiscard]] Expected<Components> parse_components(std::string_view words);
/// `1.N`
/// @return nothing when it is no version of ours.
[[nodiscard]] std::optional<Version> parse_version(std::string_view word);

/// The groups of `GetParameters`.
struct ParameterGroups {
  bool general{false};
  bool three_d{false};
  bool six_d{false};
  bool others{false};  ///< Known, but nothing that we have: the group is left out.
  [[nodiscard]] bool any() const { return general || three_d || six_d || others; }
};
[[nodiscard]] Expected<ParameterGroups> parse_parameter_groups(std::string_view words);

}  // namespace fiducap::qualisys
