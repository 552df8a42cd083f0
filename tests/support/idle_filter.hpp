#pragma once

#include <vector>

#include "estimation/body_filter.hpp"

namespace fiducap {

/// A filter that runs and estimates nothing; a test overrides what it is about.
/// @tparam Filter  BodyFilter or an interface derived from it
template <class Filter = BodyFilter>
class IdleFilter : public Filter {
 public:
  void propagate(const ImuSample&) override {}
  UpdateReport update(const TagObservations&, const MapKnowledge&) override { return {}; }
  void set_tag_priors(std::vector<KnownTag>) override {}
  void lose_motion() override {}
  [[nodiscard]] bool running() const override { return true; }
  [[nodiscard]] BodyEstimate estimate() const override { return {}; }
  void tag_beliefs(std::vector<TagBelief>& out) const override { out.clear(); }
  [[nodiscard]] std::vector<ExtrinsicsEstimate> extrinsics() const override { return {}; }
  [[nodiscard]] ClockEstimate clock(int) const override { return {}; }
};

}  // namespace fiducap
