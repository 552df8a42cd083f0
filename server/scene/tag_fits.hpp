#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <vector>

#include "base/time.hpp"
#include "estimation/body_estimate.hpp"

namespace fiducap {

/// How well one tag's sightings of late fit, by all bodies.
struct TagFit {
  int tag_id{};
  /// Running root mean square over the last 50 sightings or so: how far the corners were from where
  /// the body's filter had them after its update with that image, raw pixels. Sightings that the
  /// filter rejected count, too.
  double rms_px{};
  std::uint64_t sightings{};  ///< Since the server has started.
  Instant seen_at{};
};

/// Of every tag that a body in the workspace has seen since the server has started. Thread-safe;
/// allocates when a tag is new only.
class TagFits final {
 public:
  static constexpr std::size_t kMostTags = 4096;  ///< Further ones are not listed.

  TagFits() { fits_.reserve(kMostTags); }
  /// What an image said.
  void note(const UpdateReport& report);
  /// Sorted by id.
  [[nodiscard]] std::vector<TagFit> list() const;

 private:
  void note(const UpdateReport::CornerFit& fit, Instant seen_at);

  mutable std::mutex mutex_;
  std::vector<TagFit> fits_;
};

}  // namespace fiducap
