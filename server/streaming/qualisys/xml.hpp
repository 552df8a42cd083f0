#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "streaming/conventions/axes.hpp"
#include "streaming/qualisys/codec.hpp"
#include "streaming/qualisys/frame_board.hpp"

namespace fiducap::qualisys {

/// The reply to `GetParameters`: XML with the requested groups that are supported. The order of the
/// bodies is their index in data packets; only this text has their names.
/// @param rate_hz  of the frames, not of this client's stream
[[nodiscard]] std::string parameters_xml(const ParameterGroups& groups, Version version,
                                         std::span<const BodyTable::Entry> bodies, UpAxis up,
                                         double rate_hz);

/// Escapes & < > " ' and replaces control bytes.
[[nodiscard]] std::string escape_xml(std::string_view text);

/// Setting of one body in a settings packet.
struct BodySwitch {
  std::string name;
  bool enabled{true};
};

/// Reads `<The_6D><Body><Name>…</Name><Enabled>…</Enabled>…</Body>…</The_6D>` of a settings packet;
/// skips everything else, also bodies without `Enabled`.
/// @return nullopt for invalid XML and for more than 1000 bodies
[[nodiscard]] std::optional<std::vector<BodySwitch>> parse_body_switches(std::string_view xml);

}  // namespace fiducap::qualisys
