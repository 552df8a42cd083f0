#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "streaming/vicon/type_set.hpp"

namespace fiducap::vicon {

/// Which subjects' objects a client wants, by type. A type without an entry is unrestricted.
/// Keys are per-subject types that we offer; ids ascend and stand once.
using SubjectFilter = std::map<Type, std::vector<std::uint32_t>>;

/// All that distinguishes one client's frames from another's. Clients with equal profiles get the
/// same bytes.
struct Profile {
  TypeSet types;
  SubjectFilter filter;

  friend bool operator==(const Profile&, const Profile&) = default;
};

/// Equal profiles of different clients become one object, so that telling them apart costs a
/// comparison of pointers.
class ProfileTable final {
 public:
  [[nodiscard]] std::shared_ptr<const Profile> share(const Profile& profile) {
    std::erase_if(profiles_, [](const auto& one) { return one.expired(); });
    for (const auto& one : profiles_) {
      if (auto known = one.lock(); *known == profile) return known;
    }
    auto added = std::make_shared<const Profile>(profile);
    profiles_.push_back(added);
    return added;
  }

 private:
  std::vector<std::weak_ptr<const Profile>> profiles_;
};

}  // namespace fiducap::vicon
