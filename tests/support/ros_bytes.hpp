#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace fiducap::test {

/// Serialisation of a message.
enum class RosDialect { kRos1, kCdrLittle, kCdrBig };

/// Writes the fields of one ROS message, as ROS 1 or as CDR in either byte order.
class RosBytes final {
 public:
  explicit RosBytes(RosDialect dialect) : dialect_(dialect) {
    if (dialect != RosDialect::kRos1)
      bytes_ = {'\0', dialect == RosDialect::kCdrBig ? '\0' : '\1', '\0', '\0'};
  }

  RosBytes& u8(std::uint8_t v) { return number(v); }
  RosBytes& u32(std::uint32_t v) { return number(v); }
  RosBytes& f64(double v) { return number(std::bit_cast<std::uint64_t>(v)); }
  RosBytes& f64s(std::size_t n, double v = 0) {
    for (std::size_t i = 0; i < n; ++i) f64(v);
    return *this;
  }
  RosBytes& text(std::string_view v) {
    const bool ends = dialect_ != RosDialect::kRos1;
    u32(static_cast<std::uint32_t>(v.size() + (ends ? 1 : 0)));
    bytes_ += v;
    if (ends) bytes_ += '\0';
    return *this;
  }
  RosBytes& bytes(std::string_view v) {
    u32(static_cast<std::uint32_t>(v.size()));
    bytes_ += v;
    return *this;
  }
  RosBytes& header(std::int64_t ns, std::string_view axes = "cam0") {
    if (dialect_ == RosDialect::kRos1) u32(7);  // its count
    u32(static_cast<std::uint32_t>(ns / 1'000'000'000));
    u32(static_cast<std::uint32_t>(ns % 1'000'000'000));
    return text(axes);
  }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  template <typename U>
  RosBytes& number(U v) {
    constexpr std::size_t n = sizeof(U);
    while (dialect_ != RosDialect::kRos1 && (bytes_.size() - 4) % n != 0) bytes_ += '\0';
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t shift = dialect_ == RosDialect::kCdrBig ? n - 1 - i : i;
      bytes_ += static_cast<char>((v >> (8 * shift)) & 0xff);
    }
    return *this;
  }

  RosDialect dialect_;
  std::string bytes_;
};

inline std::string imu_message(RosDialect dialect, std::int64_t ns, std::array<double, 3> w,
                               std::array<double, 3> f) {
  RosBytes out(dialect);
  out.header(ns, "imu").f64s(4 + 9);
  for (const double v : w) out.f64(v);
  out.f64s(9);
  for (const double v : f) out.f64(v);
  return out.f64s(9).take();
}

inline std::string image_message(RosDialect dialect, std::int64_t ns, std::uint32_t width,
                                 std::uint32_t height, std::string_view pixels,
                                 std::string_view encoding = "mono8") {
  const auto row = static_cast<std::uint32_t>(pixels.size() / height);
  return RosBytes(dialect)
      .header(ns)
      .u32(height)
      .u32(width)
      .text(encoding)
      .u8(0)
      .u32(row)
      .bytes(pixels)
      .take();
}

inline std::string compressed_message(RosDialect dialect, std::int64_t ns,
                                      std::string_view picture) {
  return RosBytes(dialect).header(ns).text("mono8; png compressed").bytes(picture).take();
}

inline std::string camera_info_message(RosDialect dialect, std::int64_t ns, std::uint32_t width,
                                       std::uint32_t height, double focal_px) {
  RosBytes out(dialect);
  out.header(ns).u32(height).u32(width).text("plumb_bob").u32(5);
  for (const double k : {-0.1, 0.02, 1e-3, 2e-3, 0.0}) out.f64(k);
  for (const double k : {focal_px, 0.0, width / 2.0, 0.0, focal_px, height / 2.0, 0.0, 0.0, 1.0})
    out.f64(k);
  return out.f64s(9 + 12).u32(0).u32(0).u32(0).u32(0).u32(0).u32(0).u8(0).take();
}

}  // namespace fiducap::test
