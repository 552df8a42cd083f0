#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/gravity.hpp"
#include "capture/recording/recording.hpp"
#include "capture/sensor_source.hpp"
#include "detection/detector_config.hpp"
#include "simulation/simulation.hpp"

namespace fiducap {

/// The sensors of one body with a camera, an IMU perhaps, and the truth: what a filter gets and
/// what it is measured by.
struct EstimationData {
  std::string name;
  std::vector<SensorSample> samples;  ///< IMU and corners, as SampleMerger gives them out.
  /// Times strictly increase; every IMU sample's and every image's is among them.
  std::vector<TruthSample> truth;
  std::vector<RecordedTag> tags;  ///< True poses, sorted by id.
  TagSetConfig tag_set;
  CameraMount camera;  ///< True place, prior sigmas.
  Pose nominal_X_BV;   ///< Prior of the filter when it estimates it.
  std::optional<ImuNoise> imu;
  double gravity_m_s2{kUsualGravity_m_s2};  ///< As configured, with …
  double gravity_sigma_m_s2{kUsualGravitySigma_m_s2};
  double corner_noise_px{0.4};
  int reference_tag{};

  [[nodiscard]] const TruthSample& truth_at(Instant at) const;
  /// The truth at any moment, between the known ones by a cubic; held beyond the ends.
  [[nodiscard]] TruthSample truth_near(Instant at) const;
  /// Body rate (B axes, rad/s) at the truth's time nearest to `at`, by differences of the truth (at
  /// both ends: the neighbour's).
  [[nodiscard]] Eigen::Vector3d rate_at(Instant at) const;
  [[nodiscard]] const RecordedTag* tag(int tag_id) const;
  /// Metres travelled from the beginning to `at`.
  [[nodiscard]] double path_m(Instant at) const;
};

/// Calls `work` with every image, in order.
template <typename Data, typename Work>
void for_each_image(Data& data, Work work) {
  for (auto& sample : data.samples)
    if (auto* image = std::get_if<CornerFrame>(&sample)) work(*image);
}
[[nodiscard]] bool shows(const CornerFrame& image, int tag_id);
/// All samples of a source up to an instant, in the order of SampleMerger.
/// @param make  changes a sample; nullptr: it stays as it is
[[nodiscard]] std::vector<SensorSample> merged(
    SensorSource& source, bool has_imu, Instant end,
    const std::function<SensorSample(const SensorSample&)>& make = nullptr);
/// The lowest id of the first image that shows a tag.
[[nodiscard]] int first_tag(const EstimationData& data);

/// A pinhole camera that looks ahead.
[[nodiscard]] CameraMount forward_mount();
/// Configured pose of a camera, drawn with its sigmas.
[[nodiscard]] Pose drawn_extrinsics(const CameraMount& mount, std::uint64_t seed);

/// A body of the simulator, its tags as corners with noise or as found in images.
struct SimulatedDataSetup {
  /// Room preset and class of motion; `hall` is walked by `survey`, `hover` is nearly at rest in
  /// it, `big` is `ceiling`, `pavillon` and `ring` are walked by `loop`.
  std::string world{"table"};
  double seconds{30.0};
  double speed{1.0};  ///< Scales the motion's time.
  std::uint64_t seed{1};
  bool has_imu{true};
  simulation::FaultConfig faults{};
  /// RoomConfig::texture: images are rendered, tags found and points followed in them, led by the
  /// truth. Empty: corners with white noise.
  std::string texture{};
  /// Error of the nominal extrinsics, drawn with these sigmas per axis, which are the filter's
  /// prior.
  double extrinsics_sigma_m{0.005};
  double extrinsics_sigma_rad{0.00873};
  /// Not empty: images are rendered through a VI-Sensor's lens, and the corners are those that the
  /// server's own search finds, led by a filter of this name.
  std::string images_for{};
  simulation::DaylightConfig daylight{};  ///< Of images.
  double exposure_s{0.005};               ///< Of images: motion blur.
  double readout_s{0};                    ///< Of the rolling shutter; true …
  double readout_configured_s{0};         ///< … and as configured …
  double readout_sigma_s{0};              ///< … with this sigma.
  double imu_noise_factor{1};             ///< Factor of all configured densities.
  /// Of the true rate and specific force, before bias and noise.
  Eigen::Matrix3d gyro_gain{Eigen::Matrix3d::Identity()};
  Eigen::Matrix3d accel_gain{Eigen::Matrix3d::Identity()};
  /// Of world `ring`: its size, and what of it the body walks (TrajectoryConfig).
  simulation::RingConfig ring{};
  double from{0};
  double share{1};
  double lens_error_px{0};      ///< Of a calibration of a distorting lens (calibrated_lens).
  double corner_noise_px{0.4};  ///< Of corners without images.
  double gravity_m_s2{kUsualGravity_m_s2};  ///< True; not known to the filter.
};

/// The tag that is seen most, but not the reference; -1: no other is seen.
[[nodiscard]] int most_seen_tag(const EstimationData& data);

[[nodiscard]] EstimationData simulate(const SimulatedDataSetup& setup);

/// A body with a lens as a calibration leaves it, with corner noise as in images: its parameters'
/// errors move corners by `error_px` per coordinate over the image, without the effect of a
/// rotation.
/// @param configured_px  configured lens error, with matching sigmas of its parameters; 0: exact
[[nodiscard]] EstimationData with_calibrated_lens(SimulatedDataSetup setup, double error_px,
                                                  double configured_px);

/// A recording in the extended EuRoC layout with truth of everything. @return Error naming what is
/// missing.
[[nodiscard]] Expected<EstimationData> load_estimation_data(const std::string& folder);

}  // namespace fiducap
