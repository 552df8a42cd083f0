#include "tools/calibrate/calibration_picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tools/plot/svg_parts.hpp"
#include "tools/terminal.hpp"

namespace fiducap {
namespace {

constexpr double kPanel = 440;  // width of one view of the image
constexpr double kGap = 28;
constexpr double kTop = 92;
constexpr double kLegend = 46;
constexpr double kLine = 20;
constexpr std::size_t kMostDots = 6000;
constexpr double kDegree = std::numbers::pi / 180;

/// Pixels below each bound have the colour; the last colour is for the rest.
constexpr std::array<double, 5> kBounds_px{0.05, 0.1, 0.2, 0.5, 1.0};
constexpr std::array<const char*, 6> kColors{"#1a9850", "#91cf60", "#d9ef8b",
                                             "#fee08b", "#fc8d59", "#d73027"};
constexpr const char* kNothing = "#eceff3";

const char* color_of(double px) {
  std::size_t i = 0;
  while (i < kBounds_px.size() && px > kBounds_px[i]) ++i;
  return kColors[i];
}

std::string filled(const std::string& color) {
  return "fill=\"" + color + "\" stroke=\"#fff\" stroke-width=\"0.5\"";
}

class Picture final {
 public:
  Picture(const IntrinsicsCalibration& c, const ImageMap& map, const IntrinsicsVerdict& v)
      : c_(c), map_(map), v_(v), scale_(kPanel / c.data.width), height_(c.data.height * scale_) {}

  [[nodiscard]] std::string draw() const {
    const double width = 3 * kPanel + 4 * kGap;
    const double height =
        kTop + height_ + kLegend + kLine * static_cast<double>(v_.advice.size()) + 16;
    std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + fixed(width, 0) +
                      " " + fixed(height, 0) + "\" font-family=\"sans-serif\">\n";
    out += "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n" + heading();
    out += coverage(left(0)) + reprojection(left(1)) + uncertainty(left(2)) + legend();
    double y = kTop + height_ + kLegend + 10;
    for (const std::string& advice : v_.advice) {
      out += svg_text(kGap, y, "start", "• " + advice, 13);
      y += kLine;
    }
    return out + "</svg>\n";
  }

 private:
  static double left(int panel) { return kGap + panel * (kPanel + kGap); }

  [[nodiscard]] std::string heading() const {
    const bool good = v_.grade == IntrinsicsGrade::kGood;
    const bool weak = v_.grade == IntrinsicsGrade::kWeak;
    const std::string word = good ? "good enough" : weak ? "usable, could be better" : "refused";
    const CameraModel& camera = c_.state.camera;
    return svg_box(kGap, 16, 14, 14,
                   filled(good   ? kColors[0]
                          : weak ? kColors[3]
                                 : kColors[5])) +
           svg_text(kGap + 22, 29, "start", "Verdict: " + word, 17) +
           svg_text(kGap, 54, "start",
                    "fu " + fixed(camera.fu, 2) + "  fv " + fixed(camera.fv, 2) + "  cu " +
                        fixed(camera.cu, 2) + "  cv " + fixed(camera.cv, 2) + " px;  " +
                        std::to_string(v_.images) + " images, " + std::to_string(v_.points) +
                        " corners",
                    13);
  }

  [[nodiscard]] std::string frame(double x, const std::string& title) const {
    return svg_text(x, kTop - 10, "start", title, 14) +
           svg_box(x, kTop, kPanel, height_, "fill=\"none\" stroke=\"#888\"");
  }

  /// A box per cell. @param color  of a cell
  template <typename Color>
  [[nodiscard]] std::string cells(double x, const Color& color) const {
    std::string out;
    const double w = kPanel / map_.columns;
    const double h = height_ / map_.rows;
    for (int row = 0; row < map_.rows; ++row)
      for (int column = 0; column < map_.columns; ++column)
        out += svg_box(x + column * w, kTop + row * h, w, h, filled(color(map_.at(column, row))));
    return out;
  }

  [[nodiscard]] Eigen::Vector2d place(double x, const Eigen::Vector2d& px) const {
    return {x + (px.x() + 0.5) * scale_, kTop + (px.y() + 0.5) * scale_};
  }

  [[nodiscard]] std::string coverage(double x) const {
    std::string out = cells(x, [](const ImageCell& cell) {
      return cell.points >= kCoveringPoints ? "#dcebfa" : "#fbe3df";
    });
    const std::size_t step = c_.residuals.size() / kMostDots + 1;
    std::size_t i = 0;
    for (const CalibrationView& view : c_.data.views)
      for (const TargetSighting& sighting : view.sightings)
        for (const SeenPoint& seen : sighting.points) {
          if (i++ % step != 0) continue;
          const Eigen::Vector2d at = place(x, seen.px);
          out += "<circle cx=\"" + fixed(at.x(), 1) + "\" cy=\"" + fixed(at.y(), 1) +
                 "\" r=\"1.1\" fill=\"#2255a4\"/>\n";
        }
    return out + rings(x) +
           frame(x, "Coverage: " + fixed(100 * v_.covered, 0) + " % of the image, up to " +
                        fixed(v_.seen_angle_rad / kDegree, 0) + "° of " +
                        fixed(v_.image_angle_rad / kDegree, 0) + "° off the axis");
  }

  /// Directions of equal angle off the axis, every 10° or 20°.
  [[nodiscard]] std::string rings(double x) const {
    std::string out;
    const double step = (v_.image_angle_rad > 50 * kDegree ? 20 : 10) * kDegree;
    for (double angle = step; angle < v_.image_angle_rad; angle += step) {
      std::string points;
      for (int i = 0; i <= 72; ++i) {
        const double turn = i * 5 * kDegree;
        const auto px = c_.state.camera.project(
            {std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)});
        if (!px || !inside(*px)) {
          out += ring(points);
          points.clear();
          continue;
        }
        const Eigen::Vector2d at = place(x, *px);
        points += fixed(at.x(), 1) + "," + fixed(at.y(), 1) + " ";
      }
      out += ring(points);
    }
    return out;
  }

  [[nodiscard]] bool inside(const Eigen::Vector2d& px) const {
    return px.x() >= 0 && px.y() >= 0 && px.x() < c_.data.width && px.y() < c_.data.height;
  }

  static std::string ring(const std::string& points) {
    if (points.empty()) return {};
    return "<polyline points=\"" + points +
           "\" fill=\"none\" stroke=\"#777\" stroke-dasharray=\"4 3\" stroke-width=\"0.8\"/>\n";
  }

  [[nodiscard]] std::string reprojection(double x) const {
    std::string out = cells(x, [](const ImageCell& cell) {
      return cell.points == 0 ? kNothing : color_of(cell.rms_px);
    });
    const double side = kPanel / map_.columns;
    const double magnified = side / 2 / std::max(0.1, largest_mean());
    for (const ImageCell& cell : map_.cells) {
      if (cell.points < kCoveringPoints) continue;
      const Eigen::Vector2d from = place(x, cell.centre_px);
      const Eigen::Vector2d to = from + magnified * cell.mean_px;
      out += svg_line(from.x(), from.y(), to.x(), to.y(), "stroke=\"#333\" stroke-width=\"1.4\"") +
             "<circle cx=\"" + fixed(from.x(), 1) + "\" cy=\"" + fixed(from.y(), 1) +
             "\" r=\"1.6\" fill=\"#333\"/>\n";
    }
    return out + frame(x, "Reprojection: " + fixed(v_.reprojection_rms_px, 2) +
                              " px RMS; lines: mean, × " + fixed(magnified / scale_, 0));
  }

  [[nodiscard]] double largest_mean() const {
    double largest = 0;
    for (const ImageCell& cell : map_.cells)
      if (cell.points >= kCoveringPoints) largest = std::max(largest, cell.mean_px.norm());
    return largest;
  }

  [[nodiscard]] std::string uncertainty(double x) const {
    std::string out = cells(x, [](const ImageCell& cell) {
      return cell.in_lens ? color_of(cell.uncertainty_px) : kNothing;
    });
    return out +
           frame(x, "Directions: ± " + fixed(v_.uncertainty_median_px, 2) + " px in the median, " +
                        fixed(v_.uncertainty_worst_px, 2) + " at worst");
  }

  [[nodiscard]] std::string legend() const {
    const double y = kTop + height_ + 14;
    double x = left(1);
    std::string out;
    for (std::size_t i = 0; i < kColors.size(); ++i) {
      const std::string text =
          i < kBounds_px.size() ? "to " + fixed(kBounds_px[i], 2) + " px" : "more";
      out +=
          svg_box(x, y, 14, 14, filled(kColors[i])) + svg_text(x + 19, y + 12, "start", text, 12);
      x += 92;
    }
    return out + svg_box(x, y, 14, 14, filled(kNothing)) +
           svg_text(x + 19, y + 12, "start", "nothing known", 12);
  }

  const IntrinsicsCalibration& c_;
  const ImageMap& map_;
  const IntrinsicsVerdict& v_;
  double scale_;
  double height_;
};

}  // namespace

std::string calibration_svg(const IntrinsicsCalibration& calibration, const ImageMap& map,
                            const IntrinsicsVerdict& verdict) {
  return Picture(calibration, map, verdict).draw();
}

}  // namespace fiducap
