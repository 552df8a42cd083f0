#pragma once

#include <exception>
#include <string>
#include <string_view>

#include "base/log.hpp"

namespace fiducap::net {

/// The one place where an exception of a protocol ends, so that it costs the session or the
/// datagram that it belongs to and nothing else.
/// @param whose  called only after a failure: whom the log names, e.g. a peer; empty: nothing is
/// said
/// @return false: something was thrown
template <typename Whose, typename Work>
bool guarded(std::string_view protocol, Whose&& whose, Work&& work) noexcept {
  const auto report = [&](std::string_view what) noexcept {
    try {
      const std::string who = whose();
      if (!who.empty()) log::error(protocol, who + ": " + std::string(what));
    } catch (...) {  // nothing is left to say it with
    }
  };
  try {
    work();
    return true;
  } catch (const std::exception& failure) {
    report(failure.what());
  } catch (...) {
    report("unknown failure");
  }
  return false;
}

}  // namespace fiducap::net
