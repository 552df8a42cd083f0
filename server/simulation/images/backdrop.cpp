#include "simulation/images/image_camera.hpp"

#include <algorithm>
#include <cmath>

#include "simulation/random.hpp"

namespace fiducap::simulation {

namespace {

constexpr int kSize = 512;                // texels along one side of the texture, a power of two
constexpr float kTexelsPerMetre = 64.0F;  // repeats every 8 m

/// Adds smooth periodic noise of one wavelength (texels).
void add_noise(std::vector<float>& texture, Random& random, int wavelength, float height) {
  const int cells = kSize / wavelength;
  std::vector<float> node(static_cast<std::size_t>(cells * cells));
  for (float& value : node) value = static_cast<float>(random.uniform(-height, height));
  const auto at = [&](int x, int y) {
    return node[static_cast<std::size_t>((y % cells) * cells + x % cells)];
  };
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const float fx = static_cast<float>(x % wavelength) / static_cast<float>(wavelength);
      const float fy = static_cast<float>(y % wavelength) / static_cast<float>(wavelength);
      const int cx = x / wavelength;
      const int cy = y / wavelength;
      const float top = (1 - fx) * at(cx, cy) + fx * at(cx + 1, cy);
      const float bottom = (1 - fx) * at(cx, cy + 1) + fx * at(cx + 1, cy + 1);
      texture[static_cast<std::size_t>(y * kSize + x)] += (1 - fy) * top + fy * bottom;
    }
  }
}

/// Adds rectangles of one gray: furniture, posters, pipes.
void add_boards(std::vector<float>& texture, Random& random, int count, int smallest, int largest) {
  for (int i = 0; i < count; ++i) {
    const int x0 = random.below(kSize);
    const int y0 = random.below(kSize);
    const int width = smallest + random.below(largest - smallest);
    const int height = smallest + random.below(largest - smallest);
    const auto gray = static_cast<float>(random.uniform(-60, 60));
    for (int y = y0; y < y0 + height; ++y) {
      for (int x = x0; x < x0 + width; ++x) {
        float& texel = texture[static_cast<std::size_t>((y % kSize) * kSize + x % kSize)];
        texel = 0.4F * texel + 0.6F * (110.0F + gray);
      }
    }
  }
}

std::vector<std::uint8_t> texture_of(const std::string& kind) {
  Random random(0, Purpose::kBackdrop);
  std::vector<float> texture(static_cast<std::size_t>(kSize) * kSize, 115.0F);
  if (kind != "plain") {
    add_noise(texture, random, 128, 25);
    add_boards(texture, random, 60, 20, 110);
    add_boards(texture, random, 90, 4, 40);
    add_noise(texture, random, 8, 8);
  }
  if (kind == "sharp") {
    add_boards(texture, random, 700, 4, 14);
    add_noise(texture, random, 4, 10);
  }
  std::vector<std::uint8_t> rounded;
  for (const float value : texture)
    rounded.push_back(static_cast<std::uint8_t>(std::clamp(value, 15.0F, 225.0F)));
  return rounded;
}

std::vector<std::uint8_t> halved(const std::vector<std::uint8_t>& fine, int size) {
  std::vector<std::uint8_t> coarse;
  for (int y = 0; y < size; y += 2) {
    for (int x = 0; x < size; x += 2) {
      const auto at = [&](int dx, int dy) {
        return fine[static_cast<std::size_t>((y + dy) * size + x + dx)];
      };
      coarse.push_back(
          static_cast<std::uint8_t>((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4));
    }
  }
  return coarse;
}

}  // namespace

Backdrop::Backdrop(const RoomLook& room, const RayTable& rays, double focal_px)
    : box_(room.box),
      step_(room.texture == "sharp" ? 1 : 4),
      rays_(rays),
      texels_per_sample_(kTexelsPerMetre * static_cast<float>(step_) /
                         static_cast<float>(focal_px)) {
  texture_[0] = texture_of(room.texture);
  for (int level = 1; level < kLevels; ++level) {
    const auto i = static_cast<std::size_t>(level);
    texture_[i] = halved(texture_[i - 1], kSize >> (level - 1));
  }
  const auto traced = static_cast<std::size_t>((rays.columns() - 2) / step_ + 2);
  upper_.resize(traced);
  lower_.resize(traced);
}

void Backdrop::look_from(const Pose& X_WV, const Lighting& lighting, double exposure) {
  lighting_ = &lighting;
  exposure_ = exposure;
  R_WV_ = X_WV.rotation().cast<float>();
  // A camera outside the room is drawn from just inside its walls.
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(0.05);
  const Eigen::Vector3d inside = X_WV.p.cwiseMax(box_.low + margin).cwiseMin(box_.high - margin);
  origin_ = inside.cast<float>();
  lower_row_ = -1;
}

int Backdrop::gray_along(const Eigen::Vector3f& direction_W) const {
  // The first wall that the ray meets.
  float distance = 1e9F;
  int face = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float d = direction_W(axis);
    const float wall = static_cast<float>(d > 0 ? box_.high(axis) : box_.low(axis));
    const float along = d != 0 ? (wall - origin_(axis)) / d : 1e9F;
    if (along < distance) {
      distance = along;
      face = 2 * axis + (d > 0 ? 1 : 0);
    }
  }
  const Eigen::Vector3f hit = origin_ + distance * direction_W;
  const int axis = face / 2;
  // Each wall has another part of the texture; +800 m (100 periods) keeps the numbers positive.
  const float a = (axis == 0 ? hit.y() : hit.x()) + static_cast<float>(800 + 3 * face);
  const float b = (axis == 2 ? hit.y() : hit.z()) + static_cast<float>(800 + 5 * face);
  int level = 0;
  for (float covered = texels_per_sample_ * distance; covered > 1.5F && level + 1 < kLevels;
       covered *= 0.5F)
    ++level;
  const int gray = texel(level, a * kTexelsPerMetre, b * kTexelsPerMetre);
  // Of 128: the floor is darker, the ceiling brighter.
  constexpr std::array<int, 6> kLight{120, 128, 110, 124, 90, 140};
  const int bright = gray * kLight[static_cast<std::size_t>(face)];
  if (lighting_->even()) return bright;
  const double gain = exposure_ * lighting_->at(hit.cast<double>());
  return static_cast<int>(std::min(bright * gain, 1.0 * GrayCanvas::kMost * GrayCanvas::kFraction));
}

int Backdrop::texel(int level, float x, float y) const {
  // Bilinear, with 6 fraction bits for 8 bits of gray.
  const int mask = (kSize >> level) - 1;
  const int xf = static_cast<int>(x * 64.0F) >> level;
  const int yf = static_cast<int>(y * 64.0F) >> level;
  const std::uint8_t* top =
      texture_[static_cast<std::size_t>(level)].data() + ((yf >> 6) & mask) * (mask + 1);
  const std::uint8_t* bottom =
      texture_[static_cast<std::size_t>(level)].data() + (((yf >> 6) + 1) & mask) * (mask + 1);
  const int left = (xf >> 6) & mask;
  const int right = (left + 1) & mask;
  const int across = xf & 63;
  const int down = yf & 63;
  return ((64 - down) * ((64 - across) * top[left] + across * top[right]) +
          down * ((64 - across) * bottom[left] + across * bottom[right])) >>
         12;
}

void Backdrop::trace_row(int coarse_row, std::vector<std::int32_t>& out) const {
  const int row = std::min(coarse_row * step_, rays_.rows() - 1);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const int column = std::min(static_cast<int>(i) * step_, rays_.columns() - 1);
    const Eigen::Vector3f ray(rays_.x(row)[column], rays_.y(row)[column], 1.0F);
    out[i] = std::isfinite(ray.x()) ? gray_along(R_WV_ * ray) : 0;
  }
}

template <int kStep>
void Backdrop::draw_row(int v, std::uint16_t* out) {
  // Pixel centres are at odd multiples of 1 / (2 · step) between traced corners: for a step of 4,
  // the weights are 7:1, 5:3, 3:5, 1:7.
  constexpr int kParts = 2 * kStep;
  const int down = 2 * (v % kStep) + 1;
  const int width = rays_.columns() - 1;
  const auto blend = [&](std::size_t i) { return (kParts - down) * upper_[i] + down * lower_[i]; };
  std::int32_t left = blend(0);
  for (int u = 0; u < width; u += kStep) {
    const std::int32_t right = blend(static_cast<std::size_t>(u / kStep) + 1);
    for (int k = 0; k < kStep && u + k < width; ++k) {
      const int across = 2 * k + 1;
      out[u + k] = static_cast<std::uint16_t>(((kParts - across) * left + across * right) /
                                              (kParts * kParts));
    }
    left = right;
  }
}

void Backdrop::draw(int first, int last, GrayCanvas& canvas) {
  for (int v = first; v < last; ++v) {
    const int coarse_row = v / step_;
    if (lower_row_ != coarse_row + 1) {
      if (lower_row_ == coarse_row) {
        upper_.swap(lower_);
      } else {
        trace_row(coarse_row, upper_);
      }
      lower_row_ = coarse_row + 1;
      trace_row(lower_row_, lower_);
    }
    if (step_ == 1) {
      draw_row<1>(v, canvas.row(v));
    } else {
      draw_row<4>(v, canvas.row(v));
    }
  }
}

}  // namespace fiducap::simulation
