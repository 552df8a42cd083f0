#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "estimation/body_estimate.hpp"

namespace fiducap {

/// Says when the map has moved a body so far that somebody may want to know: by a centimetre or
/// half a degree, and by more than its sigma. Smaller corrections add up until they are worth a
/// word.
class MapCorrections final {
 public:
  /// @return what is new, in words; empty most of the time
  [[nodiscard]] std::string add(const UpdateReport& report,
                                const std::optional<BodyEstimate>& estimate);

 private:
  int generation_{};
  Eigen::Vector3d place_{Eigen::Vector3d::Zero()};  ///< About the body, W axes, since it was said.
  Eigen::Vector3d turn_{Eigen::Vector3d::Zero()};
};

}  // namespace fiducap
