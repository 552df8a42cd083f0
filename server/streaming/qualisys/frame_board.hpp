#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/object_pool.hpp"
#include "streaming/qualisys/body_table.hpp"
#include "streaming/qualisys/frame_encoder.hpp"
#include "streaming/qualisys/qualisys_config.hpp"

namespace fiducap::qualisys {

/// The newest frame, encoded at most once per profile, and only when somebody wants it.
class FrameBoard final {
 public:
  explicit FrameBoard(const QualisysConfig& config)
      : encoder_(config.axes(), config.when_invalid),
        hold_(config.when_invalid == WhenInvalid::kHold) {}

  /// @param bodies  has taken over the frame's model; outlives this
  void put(const std::shared_ptr<const SceneFrame>& frame, const BodyTable& bodies);
  /// Number of the newest frame; 0: there is none.
  [[nodiscard]] std::uint64_t number() const { return number_; }
  /// @pre number() != 0. Allocates nothing after warm-up.
  [[nodiscard]] std::shared_ptr<const EncodedFrame> encoded(const Profile& profile);

 private:
  void begin();

  struct Kept {
    Profile profile;
    std::shared_ptr<const EncodedFrame> frame;
  };
  FrameEncoder encoder_;
  bool hold_;
  std::uint64_t number_{0};
  std::shared_ptr<const SceneFrame> frame_;  ///< Until it is needed, or the next one comes.
  const BodyTable* bodies_{nullptr};
  std::vector<Kept> kept_;
  ObjectPool<EncodedFrame> pool_;
};

}  // namespace fiducap::qualisys
