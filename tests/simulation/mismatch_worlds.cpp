#include "simulation/mismatch_worlds.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/numeric.hpp"
#include "simulation/mismatch_changes.hpp"

namespace fiducap {

namespace {

using namespace mismatch;

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

using Setup = SimulatedDataSetup;
using Data = EstimationData;
using Seed = std::uint64_t;

/// A row that changes samples or the configuration.
Mismatch changed(std::string name, Mismatch::Data data) {
  return {.name = std::move(name), .data = std::move(data)};
}

std::vector<Mismatch> of_sensors() {
  return {
      {"nothing"},
      {"IMU x5", [](Setup& s, const Data&) { s.imu_noise_factor = 5; }},
      changed("stamps 3 ms", [](Data& d, Seed s) { jitter_stamps(d, 0.003, s); }),
      changed("prints 2 %", [](Data& d, Seed) { print_larger(d, 1.02); }),
      changed("one print 2 %", [](Data& d, Seed) { print_larger(d, 1.02, most_seen_tag(d)); }),
      changed("focal 1 %", [](Data& d, Seed) { lengthen_configured_lens(d, 1.01); }),
      changed("centre 5 px",
              [](Data& d, Seed) {
                move_configured_centre(d, {4, 3});
              }),
      changed("both lens",
              [](Data& d, Seed) {
                lengthen_configured_lens(d, 1.01);
                move_configured_centre(d, {4, 3});
              }),
      changed("barrel", [](Data& d, Seed) { bend_images(d, -0.05); }),
      {"readout 15 ms", [](Setup& s, const Data&) { s.readout_s = 0.015; }},
      {"gravity 9.78", at_equator},
      {"gravity 9.78 configured", at_equator,
       [](Data& d, Seed) {
         d.gravity_m_s2 = kAtEquator_m_s2;
         d.gravity_sigma_m_s2 = kGivenGravitySigma_m_s2;
       }},
  };
}

std::vector<Mismatch> of_images() {
  const auto jump = [](double by_s) {
    return [by_s](Data& d, Seed) { shift_stamps(d, length_s(d) / 2, by_s); };
  };
  return {
      {"outages", outages, [](Data& d, Seed) { blind(d, 12, 2); }},
      {.name = "misread id",
       .data = [](Data& d, Seed s) { misread_as(d, late_tag(d), s); },
       .base = "late tag",
       .base_data = [](Data& d, Seed s) { hide_at_first(d, late_tag(d), s); }},
      // The tag that comes late is the reference.
      {.name = "misread reference",
       .data = [](Data& d, Seed s) { misread_as(d, d.reference_tag, s); },
       .base = "late reference",
       .base_data =
           [](Data& d, Seed s) {
             d.reference_tag = late_tag(d);
             hide_at_first(d, d.reference_tag, s);
           }},
      {"35 ms", thirty_five_ms},
      changed("blur 20 ms", [](Data& d, Seed s) { blur(d, 0.02, s); }),
      changed("3rd image dropped", [](Data& d, Seed) { drop_every(d, 3); }),
      // A range of 500 deg/s in motions of 700 deg/s. These worlds turn at 30 to 110 deg/s.
      changed("IMU clipped", [](Data& d, Seed) { clip_gyro(d, 0.7); }),
      changed("jump -0.2 s", jump(-0.2)),
      changed("jump 0.6 s", jump(0.6)),
      changed("jump 0.2 s", jump(0.2)),
  };
}

std::vector<Mismatch> of_tags_and_wiring() {
  return {
      changed("id twice", [](Data& d, Seed s) { print_again(d, most_seen_tag(d), s); }),
      changed("two prints swapped",
              [](Data& d, Seed) {
                const std::vector<int> two = often_seen(d, 2);
                if (two.size() == 2) swap_ids(d, two[0], two[1], length_s(d) / 2);
              }),
      changed("door",
              [](Data& d, Seed s) { hang_on_door(d, most_seen_tag(d), length_s(d) / 3, s); }),
      changed("wrong family", [](Data& d, Seed) { show_no_tag(d); }),
      changed("camera turned 90 deg",
              [](Data& d, Seed) { turn_configured_camera(d, 90 * kDegree); }),
      changed("gyro axes swapped", [](Data& d, Seed) { swap_imu_axes(d); }),
      changed("0.5 s latency declared", [](Data& d, Seed) { shift_stamps(d, 0, -0.5); }),
      changed("0.5 s latency undeclared", [](Data& d, Seed) { shift_stamps(d, 0, 0.5); }),
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

const Mismatch& mismatch_named(const std::string& name) {
  const auto found = std::find_if(mismatches().begin(), mismatches().end(),
                                  [&](const Mismatch& m) { return m.name == name; });
  if (found == mismatches().end()) throw std::runtime_error("no mismatch " + name);
  return *found;
}

EstimationData unmodified_world(const SimulatedDataSetup& setup, const Mismatch& mismatch) {
  EstimationData data = simulate(setup);
  if (mismatch.base_data) mismatch.base_data(data, setup.seed);
  return data;
}

EstimationData mismatched_world(SimulatedDataSetup setup, const Mismatch& mismatch) {
  EstimationData data = unmodified_world(setup, mismatch);
  if (mismatch.faults) {
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
