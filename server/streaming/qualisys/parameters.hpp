#pragma once

#include <span>
#include <string>
#include <string_view>

#include "streaming/conventions/axes.hpp"
#include "streaming/qualisys/body_table.hpp"
#include "streaming/qualisys/command.hpp"

namespace fiducap::qualisys {

/// The answer to `GetParameters`: one XML text with the groups that were asked for and that we
/// have. The order of the bodies is their index in data packets; names stand nowhere else.
/// @param rate_hz  of the frames, not of what this client takes
[[nodiscard]] std::string parameters_xml(const ParameterGroups& groups, Version version,
                                         std::span<const BodyTable::Entry> bodies, UpAxis up,
                                         double rate_hz);

/// Text with & < > " ' and control bytes made harmless for XML.
[[nodiscard]] std::string escape_xml(std::string_view text);

}  // namespace fiducap::qualisys
