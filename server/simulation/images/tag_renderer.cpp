#include "simulation/images/image_camera.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "base/expected.hpp"

namespace fiducap::simulation {

namespace {

constexpr std::uint8_t kBlack = 28;  // gray of printed black and white; 0: no paper
constexpr std::uint8_t kWhite = 212;
constexpr int kSamples = 16;

/// Sample k is at ((k + shift + ½) mod 16 / 16, (7k mod 16 + ½) / 16) of its pixel: a lattice
/// without equal coordinates. Neighbouring pixels have different shifts, which avoids errors of up
/// to 0.1 px along edges at 45°.
struct Lattice {
  std::array<float, kSamples> across{};
  std::array<float, kSamples> down{};
  std::array<float, kSamples> both{};
};
constexpr std::size_t kShifts = 8;

constexpr std::array<Lattice, kShifts> make_lattices() {
  std::array<Lattice, kShifts> out;
  for (std::size_t shift = 0; shift < kShifts; ++shift) {
    Lattice& lattice = out[shift];
    for (std::size_t k = 0; k < kSamples; ++k) {
      lattice.across[k] = (static_cast<float>((k + shift) % kSamples) + 0.5F) / kSamples;
      lattice.down[k] = (static_cast<float>((7 * k) % kSamples) + 0.5F) / kSamples;
      lattice.both[k] = lattice.across[k] * lattice.down[k];
    }
  }
  return out;
}

constexpr std::array<Lattice, kShifts> kLattices = make_lattices();

/// Shifts alternate along rows, columns and diagonals.
inline const Lattice& lattice_of(int u, int v) {
  return kLattices[static_cast<std::size_t>(3 * u + 2 * v) % kShifts];
}

/// Index into a print with a ring of one cell around it; the comparisons map NaN to the ring.
inline std::int32_t cell_of(float x, float y, float width, std::int32_t pitch) {
  const float xr = x + 1.0F > 0.0F ? x + 1.0F : 0.0F;
  const float yr = y + 1.0F > 0.0F ? y + 1.0F : 0.0F;
  const auto column = static_cast<std::int32_t>(xr < width + 1.0F ? xr : width + 1.0F);
  const auto row = static_cast<std::int32_t>(yr < width + 1.0F ? yr : width + 1.0F);
  return row * pitch + column;
}

/// Sum of the gray values of `samples` places, times a gain on the light.
inline std::int32_t lit(std::int32_t sum, double gain, std::int32_t samples) {
  if (gain == 1.0) return sum;
  return static_cast<std::int32_t>(std::min(sum * gain, 1.0 * GrayCanvas::kMost * samples));
}

/// Point i of 16 around the outline of a square from −h to h.
Eigen::Vector3d outline(int i, double h) {
  const double along = h * (-1.0 + 0.5 * (i % 4));
  const std::array<Eigen::Vector2d, 4> sides{{{along, -h}, {h, along}, {-along, h}, {-h, -along}}};
  const Eigen::Vector2d& p = sides[static_cast<std::size_t>(i / 4)];
  return {p.x(), p.y(), 0};
}

}  // namespace

TagRenderer::TagRenderer(const CameraModel& model, const RayTable& rays, TagFamily family)
    : model_(model), rays_(rays), family_(std::move(family)) {
  const auto corners = static_cast<std::size_t>(rays.columns());
  for (CornerRow* row : {&upper_, &lower_}) {
    row->x.resize(corners);
    row->y.resize(corners);
    row->cell.resize(corners);
  }
}

const std::vector<std::uint8_t>& TagRenderer::print_of(int tag_id) {
  const auto known = prints_.find(tag_id);
  if (known != prints_.end()) return known->second;
  const int width = family_.width();
  const std::vector<std::uint8_t> modules = family_.cells(tag_id);
  std::vector<std::uint8_t> print(static_cast<std::size_t>((width + 2) * (width + 2)), 0);
  for (int row = 0; row < width; ++row) {
    for (int column = 0; column < width; ++column)
      print[static_cast<std::size_t>((row + 1) * (width + 2) + column + 1)] =
          modules[static_cast<std::size_t>(row * width + column)] > 127 ? kWhite : kBlack;
  }
  return prints_.emplace(tag_id, std::move(print)).first->second;
}

void TagRenderer::place(const std::vector<RecordedTag>& tags, std::span<const Pose> exposures,
                        const Lighting& lighting, double exposure) {
  FIDUCAP_ASSERT(!exposures.empty() && exposures.size() <= kMostExposures);
  placed_.clear();
  homographies_.clear();
  exposures_ = exposures.size();
  for (const RecordedTag& tag : tags) {
    Placed placed;
    if (!bound(tag, exposures, placed)) continue;
    placed.print = &print_of(tag.tag_id);
    placed.first_homography = homographies_.size();
    placed.gain = exposure * lighting.at(tag.X_WT.p);
    for (const Pose& X_WV : exposures) homographies_.push_back(homography(tag, X_WV));
    placed_.push_back(placed);
  }
  std::ranges::sort(placed_,
                    [](const Placed& a, const Placed& b) { return a.distance > b.distance; });
}

bool TagRenderer::bound(const RecordedTag& tag, std::span<const Pose> exposures,
                        Placed& placed) const {
  const double half = 0.5 * tag.edge_m * family_.width() / family_.edge_width();
  const Pose& middle = exposures[exposures.size() / 2];
  const Eigen::Vector3d to_tag = tag.X_WT.p - middle.p;
  placed.distance = to_tag.norm();
  const bool front = to_tag.dot(tag.X_WT.q * Eigen::Vector3d::UnitZ()) < 0;
  const double angular_radius = std::asin(std::min(1.0, 1.5 * half / placed.distance));
  const double cos_off_axis = (middle.q * Eigen::Vector3d::UnitZ()).dot(to_tag) / placed.distance;
  const double off_axis = std::acos(std::clamp(cos_off_axis, -1.0, 1.0));
  if (!front || off_axis - angular_radius > rays_.widest_rad() + 0.02) return false;
  Box box;
  for (const Pose* X_WV : {&exposures.front(), &middle, &exposures.back()})
    if (!box_by_outline(tag, *X_WV, half, box)) box_by_rays(homography(tag, *X_WV), box);
  placed.left = static_cast<int>(std::max(0.0, box.low.x()));
  placed.top = static_cast<int>(std::max(0.0, box.low.y()));
  placed.right = static_cast<int>(std::min<double>(model_.width, box.high.x()));
  placed.bottom = static_cast<int>(std::min<double>(model_.height, box.high.y()));
  return placed.left < placed.right && placed.top < placed.bottom;
}

bool TagRenderer::box_by_outline(const RecordedTag& tag, const Pose& X_WV, double half,
                                 Box& box) const {
  const Pose X_VT = X_WV.inverse() * tag.X_WT;
  Box outlined;
  for (int i = 0; i < 16; ++i) {
    const auto px = model_.project(X_VT * outline(i, half));
    if (!px) return false;
    outlined.add(*px, 0);
  }
  // Margin for the distortion between the points: 1/64 of a side plus two pixels.
  const double margin = 2.0 + (outlined.high - outlined.low).maxCoeff() / 64;
  box.add(outlined.low, margin);
  box.add(outlined.high, margin);
  return true;
}

void TagRenderer::box_by_rays(const Homography& h, Box& box) const {
  // A tag partly outside the field of view: tests whether every eighth ray meets the paper.
  constexpr int kStep = 8;
  const auto limit = static_cast<float>(family_.width());
  for (int row = 0; row < rays_.rows(); row += kStep) {
    for (int column = 0; column < rays_.columns(); column += kStep) {
      const float x = rays_.x(row)[column];
      const float y = rays_.y(row)[column];
      const float w = h[6] * x + h[7] * y + h[8];
      const float a = (h[0] * x + h[1] * y + h[2]) / w;
      const float b = (h[3] * x + h[4] * y + h[5]) / w;
      if (w < 0 && a >= 0 && a <= limit && b >= 0 && b <= limit) box.add({column, row}, kStep + 1);
    }
  }
}

TagRenderer::Homography TagRenderer::homography(const RecordedTag& tag, const Pose& X_WV) const {
  // The ray o + s d meets the paper z = 0 at (o_x d_z − o_z d_x, o_y d_z − o_z d_y) / d_z.
  const Pose X_TV = tag.X_WT.inverse() * X_WV;
  const Eigen::Matrix3d R = X_TV.rotation();
  const Eigen::RowVector3d along_x = X_TV.p.x() * R.row(2) - X_TV.p.z() * R.row(0);
  const Eigen::RowVector3d along_y = X_TV.p.y() * R.row(2) - X_TV.p.z() * R.row(1);
  // Metres to modules; module rows are numbered from the top.
  const double modules = family_.edge_width() / tag.edge_m;
  const double middle = 0.5 * family_.width();
  const Eigen::RowVector3d column = modules * along_x + middle * R.row(2);
  const Eigen::RowVector3d row = -modules * along_y + middle * R.row(2);
  Homography h{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto j = static_cast<Eigen::Index>(i);
    h[i] = static_cast<float>(column(j));
    h[3 + i] = static_cast<float>(row(j));
    h[6 + i] = static_cast<float>(R(2, j));
  }
  return h;
}

void TagRenderer::draw(int first, int last, GrayCanvas& canvas) {
  for (const Placed& tag : placed_) {
    const int top = std::max(first, tag.top);
    const int bottom = std::min(last, tag.bottom);
    if (top < bottom) draw_tag(tag, top, bottom, canvas);
  }
}

void TagRenderer::draw_tag(const Placed& tag, int first, int last, GrayCanvas& canvas) {
  const int width = tag.right - tag.left;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(last - first);
  sum_.assign(pixels, 0);
  cover_.assign(pixels, 0);
  for (std::size_t e = 0; e < exposures_; ++e) {
    const Homography& h = homographies_[tag.first_homography + e];
    corner_row(h, first, tag.left, width + 1, upper_);
    for (int v = first; v < last; ++v) {
      corner_row(h, v + 1, tag.left, width + 1, lower_);
      const auto offset = static_cast<std::size_t>(v - first) * static_cast<std::size_t>(width);
      add_row(tag, v, sum_.data() + offset, cover_.data() + offset);
      std::swap(upper_, lower_);
    }
  }
  const auto all = static_cast<std::int32_t>(kSamples * exposures_);
  const std::uint16_t* sum = sum_.data();
  const std::uint16_t* cover = cover_.data();
  for (int v = first; v < last; ++v) {
    std::uint16_t* out = canvas.row(v) + tag.left;
    for (int u = 0; u < width; ++u, ++sum, ++cover) {
      if (*cover == 0) continue;
      const std::int32_t gray = lit(*sum, tag.gain, *cover);
      out[u] = static_cast<std::uint16_t>((gray * GrayCanvas::kFraction + (all - *cover) * out[u]) /
                                          all);
    }
  }
}

void TagRenderer::corner_row(const Homography& h, int row, int left, int count,
                             CornerRow& out) const {
  const float* rx = rays_.x(row) + left;
  const float* ry = rays_.y(row) + left;
  const auto width = static_cast<float>(family_.width());
  const std::int32_t pitch = family_.width() + 2;
  float* x = out.x.data();
  float* y = out.y.data();
  std::int32_t* cell = out.cell.data();
  for (int i = 0; i < count; ++i) {
    const float w = h[6] * rx[i] + h[7] * ry[i] + h[8];
    const float inverse = 1.0F / w;
    // Rays that do not meet the paper are mapped far outside of it.
    x[i] = w < 0 ? (h[0] * rx[i] + h[1] * ry[i] + h[2]) * inverse : -1e6F;
    y[i] = w < 0 ? (h[3] * rx[i] + h[4] * ry[i] + h[5]) * inverse : -1e6F;
    cell[i] = cell_of(x[i], y[i], width, pitch);
  }
}

void TagRenderer::add_row(const Placed& tag, int v, std::uint16_t* sum,
                          std::uint16_t* cover) const {
  const std::uint8_t* print = tag.print->data();
  const auto width = static_cast<float>(family_.width());
  const std::int32_t pitch = family_.width() + 2;
  const float* x0 = upper_.x.data();
  const float* y0 = upper_.y.data();
  const float* x1 = lower_.x.data();
  const float* y1 = lower_.y.data();
  const std::int32_t* c0 = upper_.cell.data();
  const std::int32_t* c1 = lower_.cell.data();
  const int count = tag.right - tag.left;
  for (int i = 0; i < count; ++i) {
    if (c0[i] == c0[i + 1] && c0[i] == c1[i] && c0[i] == c1[i + 1]) {
      const std::uint8_t gray = print[c0[i]];
      sum[i] = static_cast<std::uint16_t>(sum[i] + kSamples * gray);
      cover[i] = static_cast<std::uint16_t>(cover[i] + (gray != 0 ? kSamples : 0));
      continue;
    }
    if ((print[c0[i]] | print[c0[i + 1]] | print[c1[i]] | print[c1[i + 1]]) == 0) continue;
    const Lattice& places = lattice_of(tag.left + i, v);
    std::array<std::int32_t, kSamples> cell;
    const float ax = x0[i + 1] - x0[i], bx = x1[i] - x0[i], dx = x1[i + 1] - x1[i] - ax;
    const float ay = y0[i + 1] - y0[i], by = y1[i] - y0[i], dy = y1[i + 1] - y1[i] - ay;
    for (std::size_t k = 0; k < kSamples; ++k)
      cell[k] = cell_of(x0[i] + places.across[k] * ax + places.down[k] * bx + places.both[k] * dx,
                        y0[i] + places.across[k] * ay + places.down[k] * by + places.both[k] * dy,
                        width, pitch);
    int gray_sum = 0;
    int covered = 0;
    for (const std::int32_t c : cell) {
      gray_sum += print[c];
      covered += print[c] != 0 ? 1 : 0;
    }
    sum[i] = static_cast<std::uint16_t>(sum[i] + gray_sum);
    cover[i] = static_cast<std::uint16_t>(cover[i] + covered);
  }
}

}  // namespace fiducap::simulation
