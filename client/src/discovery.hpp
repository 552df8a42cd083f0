#pragma once

#include <vector>

#include "fiducap/client.hpp"

namespace fiducap::sdk {

/// See Client::discover.
std::vector<Client::Found> discover(std::chrono::milliseconds timeout, std::uint16_t port);

}  // namespace fiducap::sdk
