#pragma once

#include <memory>
#include <vector>

#include "fan_out/sink.hpp"

namespace fiducap::fan_out {

/// One more client of every protocol and transport: native UDP, NatNet UDP, VRPN by UDP and by TCP,
/// Vicon, Qualisys, and a live page. They keep their subscriptions alive, read everything or
/// nothing, and are not measured.
[[nodiscard]] std::vector<std::unique_ptr<Sink>> make_bystanders(const Load& load,
                                                                 const Shared& shared);

}  // namespace fiducap::fan_out
