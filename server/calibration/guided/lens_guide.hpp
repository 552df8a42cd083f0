#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calibration/intrinsics/calibration_data.hpp"
#include "calibration/intrinsics/view_collector.hpp"

namespace fiducap {

/// What a person who holds a sheet before a camera has to know.
struct LensProgress {
  int columns{};
  int rows{};
  std::vector<int> points;  ///< Per cell of the image, row by row from the top.
  double covered{};         ///< Share of cells with points enough.
  std::size_t views{};      ///< Kept.
  std::size_t tilted{};     ///< Of those: seen at a slant.
  std::string hint;         ///< What to do next, a sentence.
  bool is_enough{};         ///< For a good lens: solve for it.
};

/// Guides a person through pictures of a target: keeps those that are sharp, still and unlike those
/// kept before, counts where in the image they were and how slanted, and says what is missing.
/// Solves nothing.
class LensGuide final {
 public:
  /// Kept at most: more would make the solution slow and hardly better.
  static constexpr std::size_t kMostViews = 80;

  /// @param width, height  of every image
  LensGuide(CalibrationTargets targets, int width, int height);

  /// @return whether it is kept
  bool look(const std::shared_ptr<const GrayImage>& image);
  /// The same with corners that were found already.
  bool look(const CornerFrame& corners);
  [[nodiscard]] const LensProgress& progress() const { return progress_; }
  /// The target in the last image; empty: there was none.
  [[nodiscard]] const CalibrationView& last_seen() const { return last_; }
  [[nodiscard]] CalibrationData data() const;
  /// After a solution that was not good: so many more views are wanted, because of this.
  void ask_for_more(std::size_t views, std::string why);

 private:
  bool judge(std::optional<CalibrationView> view);
  [[nodiscard]] bool is_still(const CalibrationView& view) const;
  [[nodiscard]] bool is_sharp(const CalibrationView& view);
  [[nodiscard]] bool is_new(const CalibrationView& view) const;
  void keep(CalibrationView view);
  void count(const CalibrationView& view);
  void advise();
  [[nodiscard]] std::string missing_part() const;

  ViewCollector collector_;
  int width_;
  int height_;
  std::vector<CalibrationView> views_;
  CalibrationView last_;
  double sharpest_{0};
  std::size_t wanted_;      ///< Views.
  std::string why_more_{};  ///< From ask_for_more.
  std::string last_said_{};
  LensProgress progress_;
};

/// How slanted a square is seen: the cosine of the angle to its normal, from its four corners alone
/// (ratio of the singular values of its affine part).
[[nodiscard]] double slant_cosine(const std::array<Eigen::Vector2d, 4>& corners);

}  // namespace fiducap
