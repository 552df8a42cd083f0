#include "estimation/moved_case.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "simulation/mismatch_changes.hpp"

namespace fiducap::bench {

namespace {

constexpr std::uint64_t kDayBefore = 500'000;
constexpr std::uint64_t kCarried = 9'101;  // key of its noise
constexpr double kSeconds = 100;
constexpr int kRobots = 3;
constexpr double kShare = 0.45;  // of the ring, that each robot walks
constexpr double kPrintLarger = 1.05;
// A door rests, swings, rests.
constexpr double kDoorRests_s = 7;
constexpr double kDoorSwings_s = 1;
// The second print hangs so far above another tag, and so far from the first.
constexpr double kAbove_m = 0.5;
constexpr double kFarApart_m = 4;

struct Words {
  std::string what;
  std::string world{"ring"};
  bool is_near{false};
  bool is_frozen{false};
};

Words words_of(const std::string& name) {
  Words out;
  for (std::size_t from = 0; from <= name.size();) {
    const std::size_t to = std::min(name.find('-', from), name.size());
    const std::string word = name.substr(from, to - from);
    if (from == 0) out.what = word;
    if (from > 0 && word != "frozen" && word != "near") out.world = word;
    out.is_frozen |= word == "frozen";
    out.is_near |= word == "near";
    from = to + 1;
  }
  return out;
}

Eigen::Vector3d direction(std::uint64_t seed) {
  std::mt19937_64 random(seed * 31 + 7);
  std::normal_distribution<double> gauss;
  const double x = gauss(random);
  const double y = gauss(random);
  return Eigen::Vector3d(x, y, gauss(random)).normalized();
}

std::vector<EstimationData> robots(const std::string& world, double seconds, std::uint64_t seed) {
  return robots_of(kRobots, seed, [&](int k, std::uint64_t own) {
    SimulatedDataSetup setup{.world = world, .seconds = seconds, .seed = own};
    setup.from = static_cast<double>(k) / kRobots;
    setup.share = kShare;
    return simulate(setup);
  });
}

/// @param t_s  since the door was opened first   @return 0: closed … 1: open
double door_at(double t_s) {
  const double half = kDoorRests_s + kDoorSwings_s;
  const double in_half = std::fmod(t_s, half);
  const double swung = std::min(1.0, in_half / kDoorSwings_s);
  return std::fmod(t_s, 2 * half) < half ? swung : 1 - swung;
}

std::set<Instant> images_with(EstimationData& data, int tag_id, double from_s = 0) {
  std::set<Instant> out;
  mismatch::for_images(data, [&](CornerFrame& image, std::size_t, double t_s) {
    if (t_s >= from_s && shows(image, tag_id)) out.insert(image.exposed_at);
  });
  return out;
}

/// Images of the robots that show both tags.
std::size_t together(std::vector<EstimationData>& data, int a, int b) {
  std::size_t count = 0;
  for (EstimationData& one : data) {
    const auto with_a = images_with(one, a);
    for (const Instant at : images_with(one, b)) count += with_a.count(at);
  }
  return count;
}

/// Above another tag that the first robot often sees, with the first print in the same images or
/// never.
RecordedTag second_print(std::vector<EstimationData>& data, int tag_id, bool is_near) {
  RecordedTag print = *data.front().tag(tag_id);
  const Eigen::Vector3d p = print.X_WT.p;
  std::optional<int> above;
  std::size_t most = 0;
  for (const int other : mismatch::often_seen(data.front(), data.front().tags.size())) {
    if (other == tag_id) continue;
    const std::size_t shared = together(data, tag_id, other);
    if (is_near && shared <= most) continue;
    const bool is_far = (data.front().tag(other)->X_WT.p - p).norm() > kFarApart_m;
    if (!is_near && (above || shared > 0 || !is_far)) continue;
    above = other;
    most = shared;
  }
  if (!above) throw std::runtime_error("no place for a second print");
  print.X_WT = data.front().tag(*above)->X_WT;
  print.X_WT.p += kAbove_m * (print.X_WT.q * Eigen::Vector3d::UnitY());
  return print;
}

void print_twice(MovedCase& out, bool is_near, std::uint64_t seed) {
  out.is_twice = true;
  const RecordedTag print = second_print(out.data, out.tag_id, is_near);
  out.places.push_back(print.X_WT);
  for (std::size_t k = 0; k < out.data.size(); ++k) {
    const auto before = images_with(out.data[k], out.tag_id);
    mismatch::show_beside(out.data[k], print, seed + k);
    for (const Instant at : images_with(out.data[k], out.tag_id))
      if (!before.contains(at)) out.elsewhere[k].insert(at);
  }
}

void carry(MovedCase& out, const std::function<Pose(double t_s)>& X_WT, std::uint64_t seed) {
  for (std::size_t k = 0; k < out.data.size(); ++k) {
    EstimationData& one = out.data[k];
    mismatch::carry(one, out.tag_id, out.at_s, X_WT, seed + kCarried + k);
    mismatch::for_images(one, [&](CornerFrame& image, std::size_t, double t_s) {
      const bool is_away = (X_WT(t_s).p - out.places.front().p).norm() > 0;
      if (t_s >= out.at_s && is_away && shows(image, out.tag_id))
        out.elsewhere[k].insert(image.exposed_at);
    });
  }
}

void insert_fault(const Words& words, std::uint64_t seed, MovedCase& out) {
  const Pose before = out.places.front();
  if (words.what == "duplicate") {
    print_twice(out, words.is_near, seed);
  } else if (words.what == "size") {
    for (std::size_t k = 0; k < out.data.size(); ++k) {
      mismatch::print_larger(out.data[k], kPrintLarger, out.tag_id);
      out.elsewhere[k] = images_with(out.data[k], out.tag_id);
    }
  } else if (words.what == "door") {
    out.places.push_back(mismatch::opened(before, 1));
    out.at_s = mismatch::length_s(out.data.front()) / 4;
    carry(
        out, [&](double t_s) { return mismatch::opened(before, door_at(t_s - out.at_s)); }, seed);
  } else {
    Pose after = before;
    after.p += std::stod(words.what) * direction(seed);
    out.places.push_back(after);
    out.at_s = mismatch::length_s(out.data.front()) / 2;
    carry(
        out, [&](double) { return after; }, seed);
  }
}

/// The map of the day before, with a print of another size if today has one.
TagMap map_of_before(const EstimationOptions& options, const Words& words, double seconds,
                     std::uint64_t seed, const MovedCase& today) {
  auto data = robots(words.world, seconds, seed + kDayBefore);
  for (EstimationData& one : data) one.tag_set = today.data.front().tag_set;
  FilterChoice choice = choice_of(options, "world", 'A');
  choice.live = true;
  return run_together(data, choice).map;
}

}  // namespace

MovedCase make_moved_case(const EstimationOptions& options, const std::string& name,
                          std::uint64_t seed) {
  const Words words = words_of(name);
  const double seconds = options.seconds > 0 ? options.seconds : kSeconds;
  MovedCase out;
  out.data = robots(words.world, seconds, seed);
  out.elsewhere.resize(out.data.size());
  if (words.what != "clean") {
    out.tag_id = most_seen_tag(out.data.front());
    out.places.push_back(out.data.front().tag(out.tag_id)->X_WT);
    insert_fault(words, seed, out);
  }
  if (words.is_frozen) {
    out.start = map_of_before(options, words, seconds, seed, out);
    for (EstimationData& one : out.data) one.reference_tag = *out.start->reference_tag;
  }
  return out;
}

}  // namespace fiducap::bench
