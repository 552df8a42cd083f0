#pragma once

#include <cstdint>
#include <string>

#include "proof/sha256.hpp"

namespace fiducap::proof {

/// Shows that a request of the control channel is made by who knows the token, for this connection
/// (challenge) and for this place in it (sequence). Formula: `fiducap/v1/control.proto`.
Digest control_proof(const std::string& token, const std::string& challenge, std::uint64_t sequence,
                     const std::string& body);

}  // namespace fiducap::proof
