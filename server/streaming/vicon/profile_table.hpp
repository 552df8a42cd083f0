#pragma once

#include <memory>
#include <vector>

#include "streaming/vicon/profile.hpp"

namespace fiducap::vicon {

/// Equal profiles of different clients become one object, so that telling them apart costs a comparison of pointers.
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
