#include <algorithm>
#include <cmath>
#include <cstdio>

#include "detection/corner_sigma.hpp"
#include "detection/observe.hpp"
#include "detection/runs.hpp"
#include "detection/tag_search.hpp"
#include "support/corner_scenes.hpp"

namespace fiducap::bench {

namespace {

constexpr unsigned kFirstScene = 50'000;  // the fit saw 1000 to 5199, the unit test 20 000 and on
constexpr double kGross_px = 1.0;

struct Seen {
  double width_px, aspect, sharpness, blur_px, noise_share, cos_tilt;
  double mean_square;  ///< px², per coordinate
  double chi_square;   ///< per coordinate
};

/// One side: its squared error across itself, in sigmas.
struct SeenSide {
  double sharpness, least_sharpness, module_px;
  double shift, turn;
};

void measure_sides(const std::array<Eigen::Vector2d, 4>& truth,
                   const std::array<Eigen::Vector2d, 4>& corners, const TagSighting& tag,
                   double pixel_noise, std::vector<SeenSide>& out) {
  const auto sigmas = side_sigmas(tag, pixel_noise);
  const Eigen::Vector2d middle = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t next = (i + 1) % 4;
    const Eigen::Vector2d along = (truth[next] - truth[i]).normalized();
    const Eigen::Vector2d normal(-along.y(), along.x());
    const double one = normal.dot(corners[i] - truth[i]);
    const double other = normal.dot(corners[next] - truth[next]);
    out.push_back({tag.sides[i].sharpness, tag.sharpness,
                   std::abs(normal.dot(middle - truth[i])) / 4,
                   std::pow(0.5 * (one + other) / sigmas[i].shift_px, 2),
                   std::pow(0.5 * (one - other) / sigmas[i].turn_px, 2)});
  }
}

Seen measure(const CornerScene& scene, std::size_t t, const CornerFrame& frame,
             const TagSighting& tag, bool& gross) {
  const auto& truth = scene.tags[t].corners_px;
  const auto corners = unbend_corners(scene.model, tag.corners_px);
  double longest = 0;
  double doubled_area = 0;
  Seen seen{};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& next = truth[(i + 1) % 4];
    longest = std::max(longest, (next - truth[i]).norm());
    doubled_area += truth[i].x() * next.y() - next.x() * truth[i].y();
    seen.mean_square += (corners[i] - truth[i]).squaredNorm() / 8;
    gross = gross || (corners[i] - truth[i]).cwiseAbs().maxCoeff() > kGross_px;
  }
  seen.width_px = 0.5 * std::abs(doubled_area) / longest;
  seen.aspect = longest / seen.width_px;
  seen.sharpness = tag.sharpness;
  seen.blur_px = scene.blur_px;
  seen.noise_share = frame.pixel_noise / tag.decision_margin;
  seen.cos_tilt = scene.cos_tilt[t];
  const double sigma = corner_sigma_px(tag, frame.pixel_noise);
  seen.chi_square = seen.mean_square / (sigma * sigma);
  return seen;
}

/// Calls `print(low, high, members)` for each bin with at least `least` members.
template <typename Item, typename Key, typename Print>
void print_bins(const char* what, const std::vector<Item>& all, const std::vector<double>& edges,
                std::size_t least, Key key, Print print) {
  std::printf("%s\n", what);
  for (std::size_t b = 0; b + 1 < edges.size(); ++b) {
    std::vector<Item> members;
    for (const Item& one : all)
      if (key(one) >= edges[b] && key(one) < edges[b + 1]) members.push_back(one);
    if (members.size() >= least) print(edges[b], edges[b + 1], members);
  }
}

template <typename Item>
double mean(const std::vector<Item>& all, double Item::*figure) {
  double sum = 0;
  for (const Item& one : all) sum += one.*figure;
  return sum / static_cast<double>(all.size());
}

void print_tag_bins(const char* what, const std::vector<Seen>& all,
                    const std::vector<double>& edges, double Seen::*key) {
  print_bins(
      what, all, edges, 10, [key](const Seen& seen) { return seen.*key; },
      [](double low, double high, const std::vector<Seen>& tags) {
        std::printf("  %6.2f to %6.2f  %5zu tags  rms %.3f px  chi-square %.2f\n", low, high,
                    tags.size(), std::sqrt(mean(tags, &Seen::mean_square)),
                    mean(tags, &Seen::chi_square));
      });
}

template <typename Key>
void print_side_bins(const char* what, const std::vector<SeenSide>& all,
                     const std::vector<double>& edges, Key key) {
  print_bins(what, all, edges, 20, key,
             [](double low, double high, const std::vector<SeenSide>& sides) {
               std::printf("  %6.2f to %6.2f  %5zu sides  chi-square of shift %.2f, of turn %.2f\n",
                           low, high, sides.size(), mean(sides, &SeenSide::shift),
                           mean(sides, &SeenSide::turn));
             });
}

void print_sides(const std::vector<SeenSide>& sides) {
  print_side_bins("sharpness of the side", sides,
                  {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.01},
                  [](const SeenSide& s) { return s.sharpness; });
  std::vector<SeenSide> smeared;
  for (const SeenSide& s : sides)
    if (s.least_sharpness < 0.7) smeared.push_back(s);
  print_side_bins("of smeared tags, side / least sharpness", smeared, {1, 1.2, 1.5, 2, 3, 9},
                  [](const SeenSide& s) { return s.sharpness / s.least_sharpness; });
  print_side_bins("module across, px", sides, {1, 1.5, 2, 3, 4, 6, 9, 15, 40},
                  [](const SeenSide& s) { return s.module_px; });
}

}  // namespace

void print_corner_calibration(int scenes) {
  TagSearch search({}, {});
  std::vector<Seen> all;
  std::vector<SeenSide> sides;
  int gross_tags = 0;
  for (int k = 0; k < scenes; ++k) {
    const CornerScene scene = make_corner_scene(kFirstScene + static_cast<unsigned>(k));
    const CornerFrame& frame = search.search({0, instant_from_ns(k), scene.image}, scene.tags);
    for (std::size_t t = 0; t < scene.tags.size(); ++t) {
      const auto tag =
          std::find_if(frame.tags.begin(), frame.tags.end(),
                       [&](const TagSighting& s) { return s.tag_id == scene.tags[t].tag_id; });
      if (tag == frame.tags.end()) continue;
      bool gross = false;
      const Seen seen = measure(scene, t, frame, *tag, gross);
      gross_tags += gross ? 1 : 0;
      if (gross) continue;
      all.push_back(seen);
      measure_sides(scene.tags[t].corners_px, unbend_corners(scene.model, tag->corners_px), *tag,
                    frame.pixel_noise, sides);
    }
  }
  std::printf(
      "\ncorner errors of %zu rendered tags, besides %d that were off by more than a pixel\n",
      all.size(), gross_tags);
  const std::vector<double> sharpness{0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.01};
  print_tag_bins("all", all, {0, 1e9}, &Seen::width_px);
  print_tag_bins("width, px", all, {8, 10, 12, 15, 18, 22, 27, 33, 40, 55, 80, 120, 300},
                 &Seen::width_px);
  print_tag_bins("longest side / width", all, {1, 1.2, 1.5, 2, 2.5, 3, 4, 6, 9}, &Seen::aspect);
  print_tag_bins("sharpness", all, sharpness, &Seen::sharpness);
  print_tag_bins("motion blur, px", all, {0, 0.01, 0.5, 1, 2, 3, 4, 6, 10}, &Seen::blur_px);
  print_tag_bins("noise / decision margin", all, {0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.12, 0.3},
                 &Seen::noise_share);
  print_tag_bins("cosine of the view angle", all, {0, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9, 1.01},
                 &Seen::cos_tilt);
  print_sides(sides);
}

}  // namespace fiducap::bench
