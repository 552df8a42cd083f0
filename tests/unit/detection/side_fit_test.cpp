#include "detection/side_fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "detection/side_scan.hpp"
#include "rendered_wall.hpp"

namespace fiducap {
namespace {

constexpr int kCells = 8;

/// RMS per coordinate over many tags and poses, from corners that are this far off.
double rms_from(double off_px, double distance) {
  RenderedWall wall(2.0);
  wall.X_WV = simulation::facing_camera(distance);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> off(-off_px, off_px);
  double squares = 0;
  int count = 0;
  for (int k = 0; k < 15; ++k) {
    wall.X_WV.p.x() += 0.0031;
    wall.X_WV.p.y() += 0.0017;
    const auto image = wall.photograph(static_cast<std::uint64_t>(k));
    for (const RecordedTag& tag : wall.tags) {
      const auto truth = wall.corners(tag);
      auto start = truth;
      for (auto& px : start) {
        const double du = off(random);
        px += Eigen::Vector2d(du, off(random));
      }
      const auto fitted = fit_sides(*image, start, kCells);
      EXPECT_TRUE(fitted);
      if (!fitted) continue;
      for (std::size_t i = 0; i < 4; ++i)
        squares += (fitted->corners_px[i] - truth[i]).squaredNorm();
      count += 8;
    }
  }
  return std::sqrt(squares / count);
}

constexpr double kBlack = 30;
constexpr double kWhite = 220;

/// A tag along the pixels on a wall of this gray, its outer corner at `corner_px`, random bits;
/// every pixel is the mean over its area and over a motion along the rows.
GrayImage tag_on(double wall, double cell_px, const Eigen::Vector2d& corner_px, unsigned seed,
                 double blur_px = 0, double white = kWhite) {
  const int size = std::max(64, static_cast<int>(24 + (kCells + 2) * cell_px));
  const int fine_steps = blur_px > 0 ? 4 : 8;
  const int steps = 1 + static_cast<int>(2 * blur_px);
  std::mt19937 random(seed);
  std::array<std::array<bool, kCells - 2>, kCells - 2> bits{};
  for (auto& row : bits)
    for (bool& bit : row) bit = random() % 2 == 1;
  const auto gray_at = [&](const Eigen::Vector2d& px) {
    const Eigen::Vector2d in_cells = (px - corner_px) / cell_px;
    const int a = static_cast<int>(std::floor(in_cells.x()));
    const int b = static_cast<int>(std::floor(in_cells.y()));
    const auto is_within = [&](int from, int to) {
      return a >= from && b >= from && a <= to && b <= to;
    };
    if (!is_within(-1, kCells)) return wall;
    if (!is_within(0, kCells - 1)) return white;
    if (!is_within(1, kCells - 2)) return kBlack;
    return bits[static_cast<std::size_t>(a - 1)][static_cast<std::size_t>(b - 1)] ? white : kBlack;
  };
  GrayImage image;
  image.resize(size, size);
  for (int k = 0; k < size * size; ++k) {
    double sum = 0;
    for (int fine = 0; fine < fine_steps * fine_steps * steps; ++fine) {
      const int place = fine / steps;
      const Eigen::Vector2d within((place % fine_steps + 0.5) / fine_steps,
                                   (place / fine_steps + 0.5) / fine_steps);
      const Eigen::Vector2d moved(blur_px * ((fine % steps + 0.5) / steps - 0.5), 0);
      sum += gray_at(Eigen::Vector2d(k % size - 0.5, k / size - 0.5) + within + moved);
    }
    image.pixels[static_cast<std::size_t>(k)] =
        static_cast<std::uint8_t>(std::lround(sum / (fine_steps * fine_steps * steps)));
  }
  return image;
}

/// Corners of a square along the pixels.
std::array<Eigen::Vector2d, 4> square_at(const Eigen::Vector2d& corner_px, double cell_px) {
  const double edge = kCells * cell_px;
  const auto [u, v] = std::pair(corner_px.x(), corner_px.y());
  return {{{u, v + edge}, {u + edge, v + edge}, {u + edge, v}, {u, v}}};
}

/// Outward error of the sides, mean over positions on the grid of pixels.
/// @param blur_px  along the rows; only the sides across it are used then
double outward_px(double wall, double cell_px, double blur_px = 0, double white = kWhite) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> part(0, 1);
  double sum = 0;
  constexpr int kTags = 16;
  for (unsigned k = 0; k < kTags; ++k) {
    const double u = 12 + part(random);
    const Eigen::Vector2d corner_px(u, 12 + part(random));
    const auto truth = square_at(corner_px, cell_px);
    const auto fitted =
        fit_sides(tag_on(wall, cell_px, corner_px, k, blur_px, white), truth, kCells);
    EXPECT_TRUE(fitted);
    if (!fitted) return std::nan("");
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d off = fitted->corners_px[i] - truth[i];
      sum += i == 1 || i == 2 ? off.x() : -off.x();
      if (blur_px == 0) sum += i < 2 ? off.y() : -off.y();
    }
  }
  return sum / ((blur_px == 0 ? 8 : 4) * kTags);
}

/// @return RMS per coordinate
double off_px(const FittedSides& fitted, const std::array<Eigen::Vector2d, 4>& truth) {
  double squares = 0;
  for (std::size_t i = 0; i < 4; ++i) squares += (fitted.corners_px[i] - truth[i]).squaredNorm();
  return std::sqrt(squares / 8);
}

TEST(SideFit, IsNotBiasedByTheGridOfPixels) {
  constexpr double kDrawn_px = 0.015;  // by steepest points: 0.045
  for (const double cell_px : {3.0, 4.0, 7.0}) {
    for (int eighth = 0; eighth < 8; ++eighth) {  // the resolution of `tag_on`
      const Eigen::Vector2d corner_px(12 + eighth / 8.0, 12 + (3 * eighth % 8) / 8.0);
      const auto truth = square_at(corner_px, cell_px);
      const auto fitted = fit_sides(tag_on(90, cell_px, corner_px, 5), truth, kCells).value();
      EXPECT_LT(off_px(fitted, truth), kDrawn_px) << cell_px << ' ' << eighth;
    }
  }
}

TEST(SideFit, FitsABlurredTagFromCornersNearlyACellOff) {
  constexpr double kCell_px = 8;
  constexpr double kBlur_px = 12;
  constexpr double kNear_px = 0.3;
  const Eigen::Vector2d corner_px(20.3, 16.6);
  const auto truth = square_at(corner_px, kCell_px);
  for (unsigned seed = 1; seed < 7; ++seed) {
    const GrayImage image = tag_on(100, kCell_px, corner_px, seed, kBlur_px);
    auto start = truth;
    start[1].x() -= 5;
    const auto fitted = fit_sides(image, start, kCells).value();
    EXPECT_LT(off_px(fitted, truth), kNear_px) << seed;
    for (const bool guessed : fitted.guessed) EXPECT_FALSE(guessed);
  }
}

TEST(SideFit, IsNotMovedByWallsOrMotion) {
  const struct {
    const char* what;
    double wall, cell_px, blur_px, white, moved_px;
  } kCases[] = {// Not corrected: 0.03 to 0.06 px, inwards on a dark wall, outwards on white paper.
                {"neighbours of a narrow border", 40, 1.75, 0, kWhite, 0.03},
                {"neighbours of a narrow border", 220, 1.75, 0, kWhite, 0.03},
                {"neighbours of a narrow border", 40, 2.5, 0, kWhite, 0.03},
                {"neighbours of a narrow border", 220, 2.5, 0, kWhite, 0.03},
                // One rise from black to wall: 0.2 px outwards. Narrower sides have a larger sigma
                // (corner_sigma). The tolerance is 1.5 sigma of a side of 3 px.
                {"a sunlit wall beyond the quiet zone", 255, 3.2, 0, 130, 0.05},
                {"a sunlit wall beyond the quiet zone", 255, 4.5, 0, 130, 0.05},
                // By the steepest points alone: 0.1 px and more inwards on a dark wall.
                {"motion over more than a cell", 40, 4.5, 1.2 * 4.5, kWhite, 0.04},
                {"motion over more than a cell", 120, 4.5, 1.2 * 4.5, kWhite, 0.04},
                // As a sharp side, because the reach ends before: 0.5 px inwards.
                {"motion over a wide cell", 40, 9.0, 1.2 * 9.0, kWhite, 0.1}};
  for (const auto& c : kCases)
    EXPECT_LT(std::abs(outward_px(c.wall, c.cell_px, c.blur_px, c.white)), c.moved_px)
        << c.what << ' ' << c.wall << ' ' << c.cell_px;
}

TEST(SideFit, FindsTheCornersOfRenderedTags) {
  // Sides along the rows and columns of pixels are the hardest; libapriltag's are 0.08 off and
  // more.
  EXPECT_LT(rms_from(0.0, 0.84), 0.05);  // 55 px
  EXPECT_LT(rms_from(0.0, 1.8), 0.06);   // 25 px
  EXPECT_LT(rms_from(0.5, 0.84), 0.05);  // from corners that are half a pixel off
  EXPECT_LT(rms_from(0.5, 1.8), 0.09);
}

TEST(SideFit, FailsWithoutSidesOrWithTooLargeSteps) {
  GrayImage flat;
  flat.resize(100, 100);
  const std::array<Eigen::Vector2d, 4> square{{{20, 80}, {80, 80}, {80, 20}, {20, 20}}};
  EXPECT_FALSE(fit_sides(flat, square, kCells));
  EXPECT_FALSE(fit_sides(flat, {{{20, 20}, {20, 20}, {20, 20}, {20, 20}}}, kCells));
  std::mt19937 random(1);
  for (auto& px : flat.pixels) px = static_cast<std::uint8_t>(random() % 256);
  if (const auto fitted = fit_sides(flat, square, kCells)) {
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_LT((fitted->corners_px[i] - square[i]).norm(), 60.0 / kCells);
  }
}

TEST(SideFit, ReadsNoPixelOutsideOfTheImage) {
  GrayImage image;
  image.resize(30, 30);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<std::uint8_t>(i);
  // Tested by a sanitizer; without one the calls only have to return.
  (void)fit_sides(image, {{{-3, 33}, {33, 33}, {33, -3}, {-3, -3}}}, kCells);
  (void)fit_sides(image, {{{0, 29}, {29, 29}, {29, 0}, {0, 0}}}, kCells);
}

struct Grays {
  double bits, black, white, wall;
};

/// Profile of an edge `off` cells outside of the assumed position, by summing over the blur.
SideProfile profile(const Grays& grays, double off, double blur, double noise = 0) {
  constexpr int kPlaces = 2000;
  std::mt19937 random(7);
  std::normal_distribution<double> gauss(0, 1);
  SideProfile out{};
  for (std::size_t j = 0; j < out.size(); ++j) {
    const double t = -1 + 2.0 * static_cast<double>(j) / static_cast<double>(out.size() - 1);
    for (int k = 0; k < kPlaces; ++k) {
      const double x = t + blur * ((k + 0.5) / kPlaces - 0.5) - off;
      const double gray = x < -1  ? grays.bits
                          : x < 0 ? grays.black
                          : x < 1 ? grays.white
                                  : grays.wall;
      out[j] += gray / kPlaces;
    }
    out[j] += noise * gauss(random);
  }
  return out;
}

constexpr Grays kNeighbours[] = {{120, 30, 210, 90}, {210, 30, 210, 210}, {30, 30, 210, 20}};

TEST(BlurredEdge, IsFoundForAllNeighboursAndBlurLengths) {
  constexpr double kExact = 0.03;  // cells: blurred over 1.8, 0.025; below 1.5 at most 0.01
  constexpr double kNear = 0.05;   // side_fit repeats the fit from there
  for (const double blur : {0.6, 0.9, 1.2, 1.5, 1.8}) {
    for (const Grays& grays : kNeighbours) {
      SCOPED_TRACE(testing::Message() << blur << ' ' << grays.bits);
      for (const double off : {-0.15, 0.0, 0.1}) {
        const auto found = find_blurred_edge(profile(grays, off, blur), 0.8).value();
        EXPECT_NEAR(found.offset, off, kExact);
      }
      const TagLevels levels{grays.black + 2, grays.white - 4};
      for (const double off : {-0.5, -0.3, 0.3, 0.5}) {
        const auto found = find_blurred_edge(profile(grays, off, blur), 0.6, levels).value();
        EXPECT_NEAR(found.offset, off, kNear);
        EXPECT_NEAR(found.blur, blur, 0.15);
      }
    }
  }
}

TEST(BlurredEdge, IsFoundInNoise) {
  constexpr double kNoise = 1.0;  // 3 in an image, mean of twelve profiles
  constexpr double kOff = 0.05;   // the steepest point is off by 0.06
  const auto found = find_blurred_edge(profile({120, 30, 210, 90}, 0.1, 1.2, kNoise), 0.8).value();
  EXPECT_NEAR(found.offset, 0.1, kOff);
}

TEST(BlurredEdge, IsNotFoundInOtherProfiles) {
  SideProfile flat{};
  flat.fill(80);
  EXPECT_FALSE(find_blurred_edge(flat, 1.0));
  EXPECT_FALSE(find_blurred_edge(profile({90, 210, 30, 120}, 0, 1.2), 1.0)) << "inside out";
  SideProfile rough{};
  for (std::size_t j = 0; j < rough.size(); ++j) rough[j] = j % 2 == 0 ? 20 : 220;
  EXPECT_FALSE(find_blurred_edge(rough, 1.0));
  flat.fill(std::nan(""));
  EXPECT_FALSE(find_blurred_edge(flat, 1.0));
}

}  // namespace
}  // namespace fiducap
