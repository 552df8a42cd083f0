#pragma once

#include <memory>
#include <span>

#include "capture/imu_sample.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/known_tag.hpp"
#include "estimation/tag_belief.hpp"

namespace fiducap {

class BodyFilter;

/// Notes down what a filter takes in and makes of it. An interface, for a start that is followed
/// again must be noted down where it happens, by somebody who knows more than a start does.
class FilterWitness {
 public:
  virtual ~FilterWitness() = default;

  virtual void add(const ImuSample& imu) = 0;
  /// After the filter has taken the image.
  /// @param beliefs  the tags in the filter's state
  /// @param known    what the map said of the image's tags
  virtual void add(const TagObservations& seen, BodyFilter& filter, const UpdateReport& report,
                   std::span<const TagBelief> beliefs, std::span<const KnownTag> known) = 0;
  /// Another one that has seen nothing yet.
  [[nodiscard]] virtual std::unique_ptr<FilterWitness> afresh() const = 0;
};

}  // namespace fiducap
