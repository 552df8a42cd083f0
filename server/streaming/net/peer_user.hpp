#pragma once

#include <optional>

#include "middleware/net/peer.hpp"

namespace fiducap::net {

/// The user of this machine whose program has that end of a TCP connection on it, as Linux tells.
/// @return nullopt: there is no such connection, or the system does not say
[[nodiscard]] std::optional<unsigned> user_of(const Peer& peer);

/// Is it a program of who started this one (also by sudo), or of root?
[[nodiscard]] bool is_of_this_user(const Peer& peer);

}  // namespace fiducap::net
