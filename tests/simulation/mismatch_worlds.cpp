#include "simulation/mismatch_worlds.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "base/numeric.hpp"
#include "base/pose.hpp"
#include "simulation/mismatch_changes.hpp"

namespace fiducap {

namespace {

using namespace mismatch;

const Eigen::Vector3d kMoved_m{0.2, 0.2, 0.1};

void outages(SimulatedDataSetup& setup, const EstimationData& clean) {
  setup.faults.wrong_id = 0.02;
  setup.faults.moved_tag = most_seen_tag(clean);
  setup.faults.moved_at_s = setup.seconds / 3;
  setup.faults.moved_by_m = kMoved_m;
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

Mismatch scaled_accelerometer(std::string name, const Eigen::Vector3d& by) {
  return {std::move(name), [by](Setup& s, const Data&) { s.accel_gain.diagonal() += by; }};
}

Mismatch exact_mount(std::string name, double off_m, double off_rad) {
  return changed(std::move(name),
                 [=](Data& d, Seed s) { displace_configured_camera(d, off_m, off_rad, s); });
}

Mismatch drifting_gyro(std::string name, double degrees_s_per_minute) {
  return changed(std::move(name),
                 [=](Data& d, Seed) { drift_gyro(d, degrees_s_per_minute * kDegree / 60); });
}

void turn_gyro(Setup& setup, const Data&) {
  setup.gyro_gain = exp_so3(1 * kDegree * random_axis(setup.seed)).toRotationMatrix();
}

void turn_imu_over(Setup& setup, const Data&) {
  setup.gyro_gain.diagonal() << 1, -1, -1;
  setup.accel_gain = setup.gyro_gain;
}

/// "nothing", then what is wrong with an IMU.
std::vector<Mismatch> of_imu() {
  return {
      {"nothing"},
      scaled_accelerometer("accel scale 0.5 %", {0.005, 0.005, 0.005}),
      scaled_accelerometer("accel scale 2 %", {0.02, 0.02, 0.02}),
      scaled_accelerometer("accel z scale 1 %", {0, 0, 0.01}),
      {"gyro scale 1 %", [](Setup& s, const Data&) { s.gyro_gain *= 1.01; }},
      {"gyro turned 1 deg", turn_gyro},
      drifting_gyro("gyro drift 1 deg/s/min", 1),
      drifting_gyro("gyro drift 5 deg/s/min", 5),
      {"IMU upside down", turn_imu_over},
      changed("lift", [](Data& d, Seed) { take_lift(d, length_s(d) / 3); }),
      changed("carried asleep", [](Data& d, Seed) { carry_asleep(d, length_s(d) / 3); }),
  };
}

std::vector<Mismatch> of_sensors() {
  return {
      {"IMU x5", [](Setup& s, const Data&) { s.imu_noise_factor = 5; }},
      changed("stamps 3 ms", [](Data& d, Seed s) { jitter_stamps(d, 0.003, s); }),
      changed("prints 2 %", [](Data& d, Seed) { print_larger(d, 1.02); }),
      changed("prints 25 %", [](Data& d, Seed) { print_larger(d, 1.25); }),
      changed("prints -20 %", [](Data& d, Seed) { print_larger(d, 0.8); }),
      changed("one print 2 %", [](Data& d, Seed) { print_larger(d, 1.02, most_seen_tag(d)); }),
      changed("one print 10 %", [](Data& d, Seed) { print_larger(d, 1.1, most_seen_tag(d)); }),
      changed("one print 25 %", [](Data& d, Seed) { print_larger(d, 1.25, most_seen_tag(d)); }),
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

std::vector<Mismatch> of_mounts_and_corners() {
  return {
      exact_mount("mount 0.5 deg exact", 0.005, 0.5 * kDegree),
      exact_mount("mount 2 deg exact", 0.03, 2 * kDegree),
      changed("corners 5 % at 5 px", [](Data& d, Seed s) { scatter_corners(d, 0.05, 5, s); }),
      {"corners 1.2 px", [](Setup& s, const Data&) { s.corner_noise_px = 1.2; }},
      changed("images mirrored", [](Data& d, Seed) { mirror_images(d); }),
      changed("focal 1 % and prints 2 %",
              [](Data& d, Seed) {
                lengthen_configured_lens(d, 1.01);
                print_larger(d, 1.02);
              }),
      {"mount exact and 20 ms", [](Setup& s, const Data&) { s.faults.image_stamp_error_s = 0.02; },
       [](Data& d, Seed s) { displace_configured_camera(d, 0.005, 0.5 * kDegree, s); }},
      {"IMU x5 and moved tag",
       [](Setup& s, const Data& clean) {
         s.imu_noise_factor = 5;
         s.faults.moved_tag = most_seen_tag(clean);
         s.faults.moved_at_s = s.seconds / 2;
         s.faults.moved_by_m = kMoved_m;
       }},
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
      changed("moved tag alone", [](Data& d, Seed s) { show_moved_tag_alone(d, kMoved_m, s); }),
      {.name = "all tags moved", .base = "kept map", .map = map_before_moves, .base_map = kept_map},
      {.name = "map of another room",
       .base = "kept map",
       .map = map_of_another_room,
       .base_map = kept_map},
      changed("wrong family", [](Data& d, Seed) { show_no_tag(d); }),
      changed("camera turned 90 deg",
              [](Data& d, Seed) { turn_configured_camera(d, 90 * kDegree); }),
      changed("gyro axes swapped", [](Data& d, Seed) { swap_imu_axes(d); }),
      changed("0.5 s latency declared", [](Data& d, Seed) { shift_stamps(d, 0, -0.5); }),
      changed("0.5 s latency undeclared", [](Data& d, Seed) { shift_stamps(d, 0, 0.5); }),
  };
}

using Kind = FoundMismatch::Kind;
using Event = BodyEvent::Kind;
using Cause = decltype(NamedCause::what);

/// What is right to report. Rows that are not here have nothing yet that names them: all is wrong.
const std::map<std::string, std::vector<Cause>>& right_causes() {
  // All of a lens is opened together.
  static const std::vector<Cause> kLens{Kind::kFocalLength, Kind::kCentreU, Kind::kCentreV,
                                        Kind::kDistortion, Kind::kLens};
  static const std::vector<Cause> kAxesOrClock{Event::kTurnsDisagree, Event::kClockJumped};
  static const std::map<std::string, std::vector<Cause>> all = [] {
    std::map<std::string, std::vector<Cause>> right{
        {"IMU x5", {Kind::kImuNoise}},
        {"IMU x5 and moved tag", {Kind::kImuNoise}},
        {"gyro drift 1 deg/s/min", {Kind::kGyroDrift}},
        {"gyro drift 5 deg/s/min", {Kind::kGyroDrift}},
        {"IMU clipped", {Kind::kGyroRange}},
        {"stamps 3 ms", {Kind::kStampJitter}},
        {"readout 15 ms", {Kind::kReadout}},
        {"focal 1 % and prints 2 %", kLens},
    };
    for (const char* name : {"accel scale 0.5 %", "accel scale 2 %", "accel z scale 1 %"})
      right[name] = {Kind::kAccelScale};
    for (const char* name : {"prints 2 %", "prints 25 %", "prints -20 %"})
      right[name] = {Kind::kAllPrints};
    for (const char* name : {"one print 2 %", "one print 10 %", "one print 25 %"})
      right[name] = {Kind::kOnePrint};
    right["gyro scale 1 %"] = {Kind::kGyroScale};
    right["gyro turned 1 deg"] = {Kind::kGyroTurn};
    for (const char* name : {"mount 0.5 deg exact", "mount 2 deg exact", "mount exact and 20 ms"})
      right[name] = {Kind::kMountPosition, Kind::kMountRotation};
    right["focal 1 % and prints 2 %"].emplace_back(Kind::kAllPrints);
    for (const char* name : {"focal 1 %", "centre 5 px", "both lens", "barrel"})
      right[name] = kLens;
    for (const char* name : {"jump -0.2 s", "jump 0.6 s", "jump 0.2 s", "camera turned 90 deg",
                             "gyro axes swapped", "0.5 s latency declared",
                             "0.5 s latency undeclared", "IMU upside down", "images mirrored"})
      right[name] = kAxesOrClock;
    return right;
  }();
  return all;
}

}  // namespace

const std::vector<Mismatch>& mismatches() {
  static const std::vector<Mismatch> all = [] {
    std::vector<Mismatch> rows;
    for (const auto& some :
         {of_imu(), of_sensors(), of_mounts_and_corners(), of_images(), of_tags_and_wiring()})
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

bool is_right(const NamedCause& cause, const Mismatch& mismatch, const EstimationData& data) {
  const auto right = right_causes().find(mismatch.name);
  if (right == right_causes().end()) return false;
  // The one wrong print is that of the tag seen most.
  if (cause.what == Cause(Kind::kOnePrint) && cause.tag_id != most_seen_tag(data)) return false;
  return std::ranges::find(right->second, cause.what) != right->second.end();
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
