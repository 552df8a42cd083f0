#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace fiducap::natnet {

/// Version of the byte layout that one client is sent.
struct Bitstream {
  std::uint8_t major{};
  std::uint8_t minor{};
  auto operator<=>(const Bitstream&) const = default;
};

/// All that we encode. 4.3 clients take 4.2; later ones carry data whose layout is not public.
inline constexpr std::array<Bitstream, 11> kBitstreams{{{2, 5},
                                                        {2, 6},
                                                        {2, 7},
                                                        {2, 8},
                                                        {2, 9},
                                                        {2, 10},
                                                        {3, 0},
                                                        {3, 1},
                                                        {4, 0},
                                                        {4, 1},
                                                        {4, 2}}};
inline constexpr Bitstream kOldest = kBitstreams.front();
inline constexpr Bitstream kNewest = kBitstreams.back();

/// `3.1`
[[nodiscard]] std::string text_of(Bitstream version);
/// `3.1`, `3.1.0` or `3.1.0.0`. @return nullopt for any other text
[[nodiscard]] std::optional<Bitstream> parse_bitstream(std::string_view text);
[[nodiscard]] bool is_supported(Bitstream version);

/// What a client says about versions when it connects; nullopt where its message is too short.
struct ClientVersions {
  std::optional<Bitstream> library;  ///< The newest its library knows.
  std::optional<Bitstream> wanted;   ///< 0.0: the server's choice.
};

/// The version a unicast client is sent: what it wants, else our default unless its library is older; always one of
/// kBitstreams.
[[nodiscard]] Bitstream negotiate(const ClientVersions& client, Bitstream server_default);

/// Versions whose frames, or model definitions, are byte for byte the same.
enum class FrameLayout { k2_5, k2_6, k2_7, k2_9, k3_0, k4_1 };
enum class ModelLayout { k2_5, k3_0, k4_0, k4_1, k4_2 };
inline constexpr std::size_t kModelLayouts = 5;

/// @pre is_supported(version)
[[nodiscard]] FrameLayout frame_layout(Bitstream version);
[[nodiscard]] ModelLayout model_layout(Bitstream version);

}  // namespace fiducap::natnet
