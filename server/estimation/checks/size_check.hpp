#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "capture/lens/lens_offset.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/checks/motion_window.hpp"
#include "estimation/checks/scale_fit.hpp"
#include "estimation/checks/scale_score.hpp"
#include "estimation/tag_belief.hpp"

namespace fiducap {

/// A tag, or all tags, whose print does not have the configured size.
struct SizeFinding {
  std::optional<int> tag_id;  ///< nullopt: all tags alike.
  double edge_m{};            ///< Configured; 0 for all tags.
  double ratio{1};            ///< Printed edge / configured edge.
  double sigma{};             ///< 1-sigma of `ratio`.
};

/// Compares how far tags seem to move, in units of their configured size, with how far the body
/// moved, in metres.
///
/// The metres come from the accelerometer (each tag for itself; the filter's places are not used,
/// because wrong sizes spoil them first), and, when three tags are seen, from the filter, whose
/// place they hold together. Looks of two seconds each; what a look cannot know (velocity, tilt,
/// bias, lever arm, clock) is left open in it. Slow motion says nothing, and then nothing is said.
/// Warns only: the filter never hears of it. Allocates nothing but for a tag's first look.
class SizeCheck final {
 public:
  SizeCheck(BodySensors sensors, double corner_noise_px);

  void add(const ImuSample& imu);
  /// A camera's lens as it is known now: looks from here on go by it.
  void set_lens(std::size_t camera, const LensOffset& lens) {
    sensors_.cameras[camera].model = lens.applied_to(configured_[camera].model);
    is_learned_[camera] = !lens.is_none();
  }

  /// What the filter made of an image.
  struct Image {
    const TagObservations& seen;
    const BodyEstimate& estimate;  ///< At the image, after its update.
    const UpdateReport& report;
    std::span<const TagBelief> own;   ///< The filter's tags …
    std::span<const KnownTag> known;  ///< … and the map's: their attitudes are used, if there.
  };
  /// Every image for which the filter has an estimate, in order of time.
  void add(const Image& image);

  /// All tags, or the worst of those that nothing was said of yet; each is said once, and again
  /// when its ratio has changed by more than 10 %.
  [[nodiscard]] std::optional<SizeFinding> take_news();

  /// For tests and benches: what is known by now. By the accelerometer, all tags together, …
  [[nodiscard]] std::optional<LogScale> common() const { return common_.result(); }
  /// … and one tag, by the accelerometer or against the other tags.
  [[nodiscard]] std::optional<LogScale> of_tag(int tag_id, bool by_imu) const;

 private:
  // κ, place of the tag, lever arm, turn of the camera …
  static constexpr int kUnknownsByOthers = 10;
  // … and velocity, constant force, accelerometer bias, clock.
  static constexpr int kUnknownsByImu = 20;
  static constexpr std::size_t kMostAtOnce = 16;

  // Places of a filter are much better known than accelerations.
  static constexpr ScaleScore::Rules kByImu{6, 0.03};
  static constexpr ScaleScore::Rules kAgainstOthers{3, 0.015};

  struct Look {
    int tag_id{-1};  ///< -1: free
    double edge_m{};
    Eigen::Quaterniond q_MT{};  ///< In the axes in which the body's attitude is followed.
    ScaleFit<kUnknownsByImu> by_imu;
    ScaleFit<kUnknownsByOthers> by_others;
  };
  struct Score {
    int tag_id{};
    double edge_m{};
    ScaleScore by_imu{kByImu};
    ScaleScore by_others{kAgainstOthers};
    double said{0};  ///< Logarithm; 0: nothing.
  };

  [[nodiscard]] bool has_imu() const { return sensors_.imu.has_value(); }
  void note_bias(const BodyEstimate& estimate);
  void begin(const Image& image);
  void finish();
  void look_at(const TagObservation& tag, const Image& image);
  /// nullptr: too many tags at once, or its attitude is not known
  [[nodiscard]] Look* look_of(const TagObservation& tag, const Image& image,
                              const Eigen::Quaterniond& q_MV);
  void compare_with_imu(const ScaleFit<kUnknownsByImu>::Vector& prior);
  void compare_with_others(const ScaleFit<kUnknownsByOthers>::Vector& prior);
  [[nodiscard]] Score* score_of(const Look& look);
  [[nodiscard]] bool all_alike(const LogScale& common) const;
  [[nodiscard]] std::optional<LogScale> verdict_on(const Score& score) const;
  [[nodiscard]] std::optional<SizeFinding> news_of_all();
  [[nodiscard]] std::optional<SizeFinding> news_of_one();

  BodySensors sensors_;
  std::vector<CameraMount> configured_;
  std::vector<bool> is_learned_;  ///< Per camera: its lens is not the configured one.
  double corner_noise_px_;
  MotionWindow motion_;
  bool open_{false};                       ///< A look is going on …
  bool imu_holds_{false};                  ///< … and the IMU's readings in it are good …
  bool others_hold_{false};                ///< … and the filter's workspace stayed the same.
  std::optional<Eigen::Vector3d> bias_w_;  ///< When the filter last knew it well.
  Instant begun_at_{};
  int camera_{};  ///< The one that began the look: a look is one camera's.
  Eigen::Vector3d p_WB_begin_{Eigen::Vector3d::Zero()};
  std::array<Look, kMostAtOnce> looks_{};
  std::vector<Score> scores_;  ///< By order of first look.
  ScaleScore common_{kByImu};
  double common_said_{0};
  bool fresh_{false};  ///< A look has ended since news were taken.
};

}  // namespace fiducap
