#pragma once

#include <optional>
#include <span>

#include "estimation/body_estimate.hpp"

namespace fiducap {

/// After a gap one tag alone said where the body is. It may have been moved meanwhile; when proven
/// tags contradict, either it or they have. What the readings said of the place during the gap is
/// weighed: whoever asks for the less likely way has moved.
class LoneReturn final {
 public:
  enum class Verdict { kOpen, kReturnWrong, kOthersWrong };

  /// @param before  nothing: the body was adrift
  void begin(int tag_id, const std::optional<BodyPlace>& before, const Eigen::Vector3d& p_WB_now);
  void forget() { *this = LoneReturn{}; }
  [[nodiscard]] bool is_watched() const { return tag_id_.has_value(); }
  [[nodiscard]] int tag_id() const { return *tag_id_; }
  /// One more image whose proven tags contradict. Two of them, in one image or in several, outvote.
  /// @param against  their ids, at least one
  /// @param shift_W  where the first of them says that the body is, from where it is thought to
  ///                 be; nothing: it does not say
  [[nodiscard]] Verdict contradict(std::span<const int> against,
                                   const std::optional<Eigen::Vector3d>& shift_W);

 private:
  std::optional<int> tag_id_;
  std::optional<BodyPlace> before_;
  Eigen::Vector3d moved_W_{Eigen::Vector3d::Zero()};  ///< The body, by the lone tag.
  int images_against_{0};
  std::optional<int> against_;                         ///< The tag that contradicts …
  bool are_several_{false};                            ///< … and whether others do.
  Eigen::Vector3d shifts_W_{Eigen::Vector3d::Zero()};  ///< Sum of those that were said …
  int said_{0};                                        ///< … so many.
};

}  // namespace fiducap
