#pragma once

#include "capture/imu_sample.hpp"
#include "daemon/config/config_file.hpp"
#include "detection/tag_family.hpp"

/// Content of a configuration file, one description per struct. A visitor V reads, prints or lists
/// the same fields:
///
///   value(key, x)             one value                word(key, x, words)   an enum
///   seconds(key, duration)    a time span in seconds   path(key, text)       a file or folder
///   secret(key, text)         read, but not printed
///   section(key, struct)      a struct of its own      list(key, structs)    a list of them
///   optional_section(key, struct)                      a struct that may be missing
///
/// Keys are the names of the members, so that the rules of `check()` point at what the user wrote.
namespace fiducap {

/// The words that a configuration uses for each enum.
namespace words {

inline constexpr std::array<Word<log::Level>, 4> kLogLevel{{{"debug", log::Level::kDebug},
                                                            {"info", log::Level::kInfo},
                                                            {"warning", log::Level::kWarning},
                                                            {"error", log::Level::kError}}};
inline constexpr std::array<Word<MapMode>, 2> kMapMode{
    {{"mapping", MapMode::kMapping}, {"frozen", MapMode::kFrozen}}};
inline constexpr std::array<Word<Distortion>, 4> kDistortion{
    {{"none", Distortion::kNone},
     {"radial-tangential", Distortion::kRadialTangential},
     {"equidistant", Distortion::kEquidistant},
     {"rational_polynomial", Distortion::kRational}}};

}  // namespace words

template <class V>
void describe(V& v, TagSetConfig& c) {
  v.value("family", c.family);
  c.family = listed_tag_family(c.family);
  v.value("size_m", c.size_m);
  v.value("sizes_m", c.sizes_m);
  v.value("ignore", c.ignore);
  v.value("max_hamming", c.max_hamming);
}

template <class V>
void describe(V& v, DetectorConfig& c) {
  v.value("decimate", c.decimate);
  v.value("blur_sigma_px", c.blur_sigma_px);
  v.value("refine_edges", c.refine_edges);
  v.value("fit_sides", c.fit_sides);
  v.value("max_hamming", c.max_hamming);
  v.value("min_decision_margin", c.min_decision_margin);
  v.value("min_white_black_diff", c.min_white_black_diff);
  v.value("adapt_contrast", c.adapt_contrast);
  v.value("regions", c.regions);
  v.value("search_period_s", c.search_period_s);
  v.value("threads", c.threads);
}

template <class V>
void describe(V& v, EstimatorConfig& c) {
  v.value("corner_noise_px", c.corner_noise_px);
  v.value("learn_corner_noise", c.learn_corner_noise);
  v.value("doubt_configuration", c.doubt_configuration);
  v.value("estimate_extrinsics", c.estimate_extrinsics);
  v.value("estimate_clocks", c.estimate_clocks);
  v.value("refine_intrinsics", c.refine_intrinsics);
  v.value("landmarks", c.landmarks);
  v.value("gate_probability", c.gate_probability);
  v.value("max_local_tags", c.max_local_tags);
  v.former("hand_over_above", "the map takes all tags, with correlations");
  v.value("branch_evidence", c.branch_evidence);
  v.value("branch_views", c.branch_views);
  v.value("max_imu_gap_s", c.max_imu_gap_s);
  v.value("motion_accel_m_s2_rtHz", c.motion_accel_m_s2_rtHz);
  v.value("motion_angular_rad_s2_rtHz", c.motion_angular_rad_s2_rtHz);
}

template <class V>
void describe(V& v, MapSettings& c) {
  v.word("mode", c.builder.mode, words::kMapMode);
  v.path("store", c.store);
  v.path("file", c.file);
  v.value("file_tag_size_m", c.file_tag_size_m);
  v.value("reference_tag", c.reference_tag);
  v.value("reference_pose", c.reference_pose);
  v.value("floor_tags", c.floor_tags);
  v.value("use_learned_extrinsics", c.use_learned_extrinsics);
  v.former("publish_position_sigma_m", "a tag joins the map with any sigma");
  v.former("publish_rotation_sigma_rad", "a tag joins the map with any sigma");
  v.value("publish_sightings", c.builder.publish_sightings);
  v.value("refine_period_s", c.builder.refine_period_s);
  v.value("correction_ramp_s", c.correction_ramp_s);
  v.value("commit_period_s", c.builder.commit_period_s);
}

template <class V>
void describe(V& v, CameraModel& c) {
  v.value("width", c.width);
  v.value("height", c.height);
  v.value("fu", c.fu);
  v.value("fv", c.fv);
  v.value("cu", c.cu);
  v.value("cv", c.cv);
  v.word("distortion", c.distortion, words::kDistortion);
  v.value("coefficients", c.coefficients);
}

template <class V>
void describe(V& v, CameraMount& c) {
  v.section("model", c.model);
  v.value("X_BV", c.X_BV);
  v.value("position_sigma_m", c.position_sigma_m);
  v.value("rotation_sigma_rad", c.rotation_sigma_rad);
  v.seconds("time_shift_s", c.time_shift);
  v.value("time_shift_sigma_s", c.time_shift_sigma_s);
  v.value("readout_s", c.readout_s);
  v.value("readout_sigma_s", c.readout_sigma_s);
  v.value("focal_sigma", c.focal_sigma);
  v.value("centre_sigma_px", c.centre_sigma_px);
  v.value("k1_sigma", c.k1_sigma);
  v.value("lens_error_px", c.lens_error_px);
  v.value("rate_hz", c.rate_hz);
}

template <class V>
void describe(V& v, CameraConfig& c) {
  v.optional_section("source", c.source);
  v.path("calibration", c.calibration);
  describe(v, c.mount);
}

template <class V>
void describe(V& v, ImuNoise& c) {
  v.value("gyro_noise_rad_s_rtHz", c.gyro_noise_rad_s_rtHz);
  v.value("gyro_walk_rad_s2_rtHz", c.gyro_walk_rad_s2_rtHz);
  v.value("accel_noise_m_s2_rtHz", c.accel_noise_m_s2_rtHz);
  v.value("accel_walk_m_s3_rtHz", c.accel_walk_m_s3_rtHz);
  v.value("rate_hz", c.rate_hz);
  v.value("gyro_range_rad_s", c.gyro_range_rad_s);
  v.value("accel_range_m_s2", c.accel_range_m_s2);
}

/// The part is first, because it gives the defaults of the other keys.
template <class V>
void describe(V& v, ImuConfig& c) {
  v.value("part", c.part);
  if constexpr (requires { V::kFills; }) {
    if (const auto known = noise_of_part(c.part, c.rate_hz)) static_cast<ImuNoise&>(c) = *known;
  }
  describe(v, static_cast<ImuNoise&>(c));
}

template <class V>
void describe(V& v, BodyLimits& c) {
  v.value("max_position_sigma_m", c.max_position_sigma_m);
  v.value("max_rotation_sigma_rad", c.max_rotation_sigma_rad);
  v.value("coast_after_s", c.coast_after_s);
  v.value("lose_after_s", c.lose_after_s);
}

}  // namespace fiducap
