#pragma once

#include <optional>
#include <string>

#include "base/expected.hpp"
#include "streaming/natnet/request.hpp"
#include "streaming/natnet/server_view.hpp"

namespace fiducap::natnet {

/// `GetProperty,<node>,<name>`, `GetProperty,,<name>` or `GetProperty,<name>`. Names in any case,
/// blanks do not count. Of a body: Name, Active (Enabled), StreamingID (AssetID, ID),
/// TrackingValid. Of the server: FrameRate (Master Rate), UpAxis, Units, Bitstream, Name,
/// DataPort, MulticastAddress, CommandPort, TransmissionType.
/// @return nullopt: no such node or property
[[nodiscard]] std::optional<std::string> get_property(const Command& command,
                                                      const ServerView& server);

/// `SetProperty,<node>,<name>,<value>`. Of a body: Name, Active (Enabled). The server's are set in
/// its configuration.
/// @pre server.desk != nullptr, the caller may change things
[[nodiscard]] Expected<void> set_property(const Command& command, const ServerView& server);

}  // namespace fiducap::natnet
