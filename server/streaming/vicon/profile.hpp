#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "streaming/vicon/type_set.hpp"

namespace fiducap::vicon {

/// Which subjects' objects a client wants, by type. A type without an entry is unrestricted.
/// Keys are per-subject types that we offer; ids ascend and stand once.
using SubjectFilter = std::map<Type, std::vector<std::uint32_t>>;

/// All that distinguishes one client's frames from another's. Clients with equal profiles get the same bytes.
struct Profile {
  TypeSet types;
  SubjectFilter filter;

  friend bool operator==(const Profile&, const Profile&) = default;
};

}  // namespace fiducap::vicon
