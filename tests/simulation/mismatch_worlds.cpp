#include "simulation/mismatch_worlds.hpp"

#include <cmath>
#include <numbers>

#include "simulation/mismatch_changes.hpp"

namespace fiducap {

namespace {

using namespace mismatch;

constexpr double kDegree = std::numbers::pi / 180;

void outages(SimulatedDataSetup& setup, const EstimationData& clean) {
  setup.faults.wrong_id = 0.02;
  setup.faults.moved_tag = most_seen_tag(clean);
  setup.faults.moved_at_s = setup.seconds / 3;
  setup.faults.moved_by_m = {0.2, 0.2, 0.1};
}

/// Late by a clock, with lost samples and a displaced camera (configured with that sigma).
void thirty_five_ms(SimulatedDataSetup& setup, const EstimationData&) {
  setup.faults.image_stamp_error_s = 0.035;
  setup.faults.drop_imu = 0.02;
  setup.extrinsics_sigma_m = 0.03 / std::sqrt(3.0);
  setup.extrinsics_sigma_rad = 3 * kDegree / std::sqrt(3.0);
}

constexpr double kAtEquator_m_s2 = 9.78;

void at_equator(SimulatedDataSetup& setup, const EstimationData&) {
  setup.gravity_m_s2 = kAtEquator_m_s2;
}

std::vector<Mismatch> of_sensors() {
  return {
      {"nothing"},
      {"IMU x5", [](SimulatedDataSetup& s, const EstimationData&) { s.imu_noise_factor = 5; }},
      {"stamps 3 ms", {}, [](EstimationData& d, std::uint64_t s) { jitter_stamps(d, 0.003, s); }},
      {"prints 2 %", {}, [](EstimationData& d, std::uint64_t) { print_larger(d, 1.02); }},
      {"one print 2 %",
       {},
       [](EstimationData& d, std::uint64_t) { print_larger(d, 1.02, most_seen_tag(d)); }},
      {"focal 1 %", {}, [](EstimationData& d, std::uint64_t) { lengthen_told_lens(d, 1.01); }},
      {"centre 5 px",
       {},
       [](EstimationData& d, std::uint64_t) {
         move_told_centre(d, {4, 3});
       }},
      {"both lens",
       {},
       [](EstimationData& d, std::uint64_t) {
         lengthen_told_lens(d, 1.01);
         move_told_centre(d, {4, 3});
       }},
      {"barrel", {}, [](EstimationData& d, std::uint64_t) { bend_images(d, -0.05); }},
      {"readout 15 ms", [](SimulatedDataSetup& s, const EstimationData&) { s.readout_s = 0.015; }},
      {"gravity 9.78", at_equator},
      {"gravity 9.78 told", at_equator,
       [](EstimationData& d, std::uint64_t) {
         d.gravity_m_s2 = kAtEquator_m_s2;
         d.gravity_sigma_m_s2 = kGivenGravitySigma_m_s2;
       }},
  };
}

std::vector<Mismatch> of_images() {
  return {
      {"outages", outages, [](EstimationData& d, std::uint64_t) { blind(d, 12, 2); }},
      {"misread id",
       {},
       [](EstimationData& d, std::uint64_t s) { misread_as(d, late_tag(d), s); },
       "late tag",
       {},
       [](EstimationData& d, std::uint64_t s) { hide_at_first(d, late_tag(d), s); }},
      // The tag that comes late is the reference.
      {"misread reference",
       {},
       [](EstimationData& d, std::uint64_t s) { misread_as(d, d.reference_tag, s); },
       "late reference",
       {},
       [](EstimationData& d, std::uint64_t s) {
         d.reference_tag = late_tag(d);
         hide_at_first(d, d.reference_tag, s);
       }},
      {"35 ms", thirty_five_ms},
      {"blur 20 ms", {}, [](EstimationData& d, std::uint64_t s) { blur(d, 0.02, s); }},
      {"3rd image dropped", {}, [](EstimationData& d, std::uint64_t) { drop_every(d, 3); }},
      // A range of 500 deg/s in motions of 700 deg/s. These worlds turn at 30 to 110 deg/s.
      {"IMU clipped", {}, [](EstimationData& d, std::uint64_t) { clip_gyro(d, 0.7); }},
      {"jump -0.2 s",
       {},
       [](EstimationData& d, std::uint64_t) { shift_stamps(d, length_s(d) / 2, -0.2); }},
      {"jump 0.6 s",
       {},
       [](EstimationData& d, std::uint64_t) { shift_stamps(d, length_s(d) / 2, 0.6); }},
      {"jump 0.2 s",
       {},
       [](EstimationData& d, std::uint64_t) { shift_stamps(d, length_s(d) / 2, 0.2); }},
  };
}

std::vector<Mismatch> of_tags_and_wiring() {
  return {
      {"id twice",
       {},
       [](EstimationData& d, std::uint64_t s) { print_again(d, most_seen_tag(d), s); }},
      {"two prints swapped",
       {},
       [](EstimationData& d, std::uint64_t) {
         const std::vector<int> two = often_seen(d, 2);
         if (two.size() == 2) swap_ids(d, two[0], two[1], length_s(d) / 2);
       }},
      {"door",
       {},
       [](EstimationData& d, std::uint64_t s) {
         hang_on_door(d, most_seen_tag(d), length_s(d) / 3, s);
       }},
      {"wrong family", {}, [](EstimationData& d, std::uint64_t) { show_no_tag(d); }},
      {"camera turned 90 deg",
       {},
       [](EstimationData& d, std::uint64_t) { turn_told_camera(d, 90 * kDegree); }},
      {"gyro axes swapped", {}, [](EstimationData& d, std::uint64_t) { swap_imu_axes(d); }},
      {"0.5 s latency declared",
       {},
       [](EstimationData& d, std::uint64_t) { shift_stamps(d, 0, -0.5); }},
      {"0.5 s latency undeclared",
       {},
       [](EstimationData& d, std::uint64_t) { shift_stamps(d, 0, 0.5); }},
  };
}

}  // namespace

const std::vector<Mismatch>& mismatches() {
  static const std::vector<Mismatch> all = [] {
    std::vector<Mismatch> rows;
    for (const auto& some : {of_sensors(), of_images(), of_tags_and_wiring()})
      rows.insert(rows.end(), some.begin(), some.end());
    return rows;
  }();
  return all;
}

EstimationData unmodified_world(SimulatedDataSetup setup, const Mismatch& mismatch) {
  if (mismatch.base_setup) mismatch.base_setup(setup);
  EstimationData data = simulate(setup);
  if (mismatch.base_data) mismatch.base_data(data, setup.seed);
  return data;
}

EstimationData mismatched_world(SimulatedDataSetup setup, const Mismatch& mismatch) {
  EstimationData data = unmodified_world(setup, mismatch);
  if (mismatch.faults) {
    if (mismatch.base_setup) mismatch.base_setup(setup);
    const int reference_tag = data.reference_tag;
    mismatch.faults(setup, data);
    data = simulate(setup);
    if (mismatch.base_data) mismatch.base_data(data, setup.seed);
    data.reference_tag = reference_tag;  // a wrong id in the first image is not the reference
  }
  if (mismatch.data) mismatch.data(data, setup.seed);
  return data;
}

}  // namespace fiducap
