#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/time.hpp"

namespace fiducap::v4l2 {

/// Counts images that did not make it, and says so now and then: at once, and once a minute while
/// it goes on.
class LostImages final {
 public:
  /// Why an image is missing.
  enum class Cause {
    kSkipped,     ///< The device or its driver left it out: its number is missing.
    kDamaged,     ///< The driver says so.
    kShort,       ///< Fewer bytes than pixels: half an image.
    kUnreadable,  ///< A JPEG that is damaged or has no end.
    kOutOfOrder,  ///< Its stamp is not later than the one before.
  };
  struct Counts {
    std::uint64_t skipped{}, damaged{}, shortened{}, unreadable{}, out_of_order{};
  };

  explicit LostImages(std::string device) : device_(std::move(device)) {}

  void add(Cause cause, std::uint32_t images = 1);
  /// An image came. @return how many were lost before it
  [[nodiscard]] std::uint32_t came(Instant now);
  [[nodiscard]] const Counts& counts() const { return counts_; }
  /// `12 left out by the device, 3 damaged`; empty: none.
  [[nodiscard]] std::string text() const;

 private:
  std::string device_;
  Counts counts_;
  std::uint32_t since_last_{0};
  bool is_unsaid_{false};
  std::optional<Instant> said_at_;
};

}  // namespace fiducap::v4l2
