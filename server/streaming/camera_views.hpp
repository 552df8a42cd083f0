#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fiducap {

/// How somebody wants to watch a camera.
struct ViewWish {
  static constexpr int kLeastWidth_px = 80;
  static constexpr int kMostWidth_px = 4096;
  static constexpr int kMostPerSecond = 10;

  int width_px{640};  ///< At most; a narrower image stays as it is.
  int per_second{kMostPerSecond};
  bool candidates{false};  ///< Look again for what is nearly a tag: as dear as finding tags.

  bool operator==(const ViewWish&) const = default;
};

/// Pictures of cameras, made elsewhere and only while somebody watches. Called on one thread;
/// every call returns at once.
class CameraViews {
 public:
  struct Camera {
    int body_id{};
    int camera{};  ///< Index among the body's.
    int width{}, height{};
    double rate_hz{};  ///< As configured.
  };
  /// A message for a page, see streaming/web/view_codec.hpp.
  using Picture = std::shared_ptr<const std::string>;

  virtual ~CameraViews() = default;
  /// In the order of bodies; it never changes.
  [[nodiscard]] virtual const std::vector<Camera>& cameras() const = 0;
  /// @param camera  place in the list   @param wish  nullopt: nobody watches it any more
  virtual void watch(std::size_t camera, const std::optional<ViewWish>& wish) = 0;
  /// The newest picture, once. @return nullptr: there is no new one
  [[nodiscard]] virtual Picture take(std::size_t camera) = 0;
};

}  // namespace fiducap
