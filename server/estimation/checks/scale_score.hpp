#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "estimation/checks/scale_fit.hpp"

namespace fiducap {

/// What several independent looks at one scale say together: their weighted median, and how far it
/// can be trusted by how much they differ. A few looks that went wrong (a tag that was moved, a
/// reading at its end) change neither. The newest 32 count.
class ScaleScore final {
 public:
  struct Rules {
    std::size_t fewest_looks{4};
    double systematic{0.03};  ///< Of a look, what its own sigma does not know.
  };
  explicit ScaleScore(const Rules& rules) : rules_(rules) {}

  void add(const LogScale& look);
  [[nodiscard]] std::size_t looks() const { return count_; }
  /// nullopt with fewer looks than the rules ask for.
  [[nodiscard]] std::optional<LogScale> result() const {
    return count_ < rules_.fewest_looks ? std::nullopt : guess();
  }
  /// The same with any number of looks; nullopt without any.
  [[nodiscard]] std::optional<LogScale> guess() const;
  /// Share of the looks' weight that lies on the same side of zero as `value`, by 2 % at least.
  [[nodiscard]] double agreement(double value) const;

 private:
  static constexpr std::size_t kMost = 32;

  [[nodiscard]] double weight_of(const LogScale& look) const {
    return 1 / (look.sigma * look.sigma + rules_.systematic * rules_.systematic);
  }

  Rules rules_;
  std::array<LogScale, kMost> looks_{};
  std::size_t count_{0};
  std::size_t next_{0};
};

}  // namespace fiducap
