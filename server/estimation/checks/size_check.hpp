#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "capture/lens/camera_model.hpp"
#include "detection/tag_observation.hpp"
#include "estimation/body_estimate.hpp"
#include "estimation/body_filter.hpp"
#include "estimation/checks/scale_fit.hpp"
#include "estimation/known_tag.hpp"

namespace fiducap {

/// A tag, or all tags, with another size than configured.
struct SizeFinding {
  std::optional<int> tag_id;  ///< nullopt: all tags equally.
  double edge_m{};            ///< Configured; 0 for all tags.
  double ratio{1};            ///< Printed edge / configured edge.
  double sigma{};             ///< 1-sigma of `ratio`.
};

/// Compares the motion relative to tags, in units of their configured size, with the body's motion
/// in metres.
///
/// The latter comes from the accelerometer (per tag; wrong sizes corrupt the filter's positions)
/// and, with three tags in view, from the filter. Each estimate ("look") takes two seconds, with
/// velocity, tilt, bias, lever arm and clock as unknowns; slow motion gives none. Only reports;
/// does not change the filter. Allocates only at a tag's first look.
class SizeCheck final {
 public:
  SizeCheck(BodySensors sensors, double corner_noise_px);

  void add(const ImuSample& imu);
  /// Sets a camera's estimated lens for further looks.
  void set_lens(std::size_t camera, const LensOffset& lens) {
    sensors_.cameras[camera].model = lens.applied_to(configured_[camera].model);
    is_learned_[camera] = !lens.is_none();
  }

  /// An image with the filter's result.
  struct Image {
    const TagObservations& seen;
    const BodyEstimate& estimate;  ///< At the image, after its update.
    const UpdateReport& report;
    std::span<const TagBelief> own;   ///< The filter's tags, for their attitudes.
    std::span<const KnownTag> known;  ///< The map's tags, for their attitudes.
  };
  /// Every image for which the filter has an estimate, in order of time.
  void add(const Image& image);

  /// All tags, or the worst one not reported yet; again when its ratio has changed by 10 %.
  [[nodiscard]] std::optional<SizeFinding> take_event();

  /// For tests: common scale by the accelerometer.
  [[nodiscard]] std::optional<LogScale> common() const { return common_.result(); }
  /// For tests: scale of one tag, by the accelerometer or relative to the other tags.
  [[nodiscard]] std::optional<LogScale> of_tag(int tag_id, bool by_imu) const;

 private:
  // κ, position of the tag, lever arm, rotation of the camera.
  static constexpr int kUnknownsByOthers = 10;
  // Also velocity, constant force, accelerometer bias, clock.
  static constexpr int kUnknownsByImu = 20;
  static constexpr std::size_t kMostAtOnce = 16;

  // Positions of a filter are more accurate than integrated accelerations.
  static constexpr ScaleScore::Rules kByImu{6, 0.03};
  static constexpr ScaleScore::Rules kAgainstOthers{3, 0.015};

  struct Look {
    int tag_id{-1};  ///< -1: free
    double edge_m{};
    Eigen::Quaterniond q_MT{};  ///< In the axes of the body's attitude.
    ScaleFit<kUnknownsByImu> by_imu;
    ScaleFit<kUnknownsByOthers> by_others;
  };
  struct Score {
    int tag_id{};
    double edge_m{};
    ScaleScore by_imu{kByImu};
    ScaleScore by_others{kAgainstOthers};
    double reported{0};  ///< Logarithm; 0: not reported.
  };

  void begin(const Image& image);
  void finish();
  void look_at(const TagObservation& tag, const Image& image);
  /// @return nullptr: too many tags, or unknown attitude
  [[nodiscard]] Look* look_of(const TagObservation& tag, const Image& image,
                              const Eigen::Quaterniond& q_MV);
  void compare_with_imu(const ScaleFit<kUnknownsByImu>::Vector& prior);
  void compare_with_others(const ScaleFit<kUnknownsByOthers>::Vector& prior);
  [[nodiscard]] Score* score_of(const Look& look);
  [[nodiscard]] bool all_alike(const LogScale& common) const;
  [[nodiscard]] std::optional<LogScale> verdict_on(const Score& score) const;

  BodySensors sensors_;
  std::vector<CameraMount> configured_;
  std::vector<bool> is_learned_;  ///< Per camera: its lens differs from the configured one.
  double corner_noise_px_;
  MotionWindow motion_;
  bool open_{false};                       ///< A look is in progress.
  bool imu_holds_{false};                  ///< Its IMU samples are valid.
  bool others_hold_{false};                ///< The filter's workspace did not change.
  std::optional<Eigen::Vector3d> bias_w_;  ///< Last well-known bias of the filter.
  Instant begun_at_{};
  int camera_{};  ///< Of the look.
  Eigen::Vector3d p_WB_begin_{Eigen::Vector3d::Zero()};
  std::array<Look, kMostAtOnce> looks_{};
  std::vector<Score> scores_;  ///< By order of first look.
  ScaleScore common_{kByImu};
  double common_reported_{0};
  bool fresh_{false};  ///< A look has ended since take_event().
};

/// Detects that a large share of the tags in view is rejected over many seconds: a common cause is
/// wrong (sizes, lens, extrinsics), not a single tag.
class RejectionWatch final {
 public:
  /// Adds an image, in order of time.
  /// @return the share, once when above 30 % over ten seconds; again only after it was below 15 %
  [[nodiscard]] std::optional<double> add(const UpdateReport& report);

 private:
  static constexpr std::size_t kSeconds = 10;

  struct Second {
    int used{0};
    int rejected{0};
  };
  [[nodiscard]] std::optional<double> judge();

  std::array<Second, kSeconds> seconds_{};
  std::size_t full_{0};  ///< Complete seconds.
  std::optional<Instant> begun_at_;
  Second now_{};
  bool reported_{false};
};

}  // namespace fiducap
