#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "streaming/operator_api.hpp"

namespace fiducap {

/// Parameters of a camera preview.
struct ViewRequest {
  static constexpr int kLeastWidth_px = 80;
  static constexpr int kMostWidth_px = 4096;
  static constexpr int kMostPerSecond = 10;

  int width_px{640};  ///< At most; a narrower image stays as it is.
  int per_second{kMostPerSecond};
  bool candidates{false};  ///< Also search for near-miss quads (as expensive as detection).

  bool operator==(const ViewRequest&) const = default;
};

/// Pictures of cameras, made on another thread and only while they are watched. Called on one
/// thread; every call returns at once. Implemented in `daemon`.
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
  /// In the order of bodies; constant.
  [[nodiscard]] virtual const std::vector<Camera>& cameras() const = 0;
  /// @param camera  place in the list   @param request  nullopt: no longer watched
  virtual void watch(std::size_t camera, const std::optional<ViewRequest>& request) = 0;
  /// The newest picture, once. @return nullptr: no new one
  [[nodiscard]] virtual Picture take(std::size_t camera) = 0;
};

/// The set-up: creates a configuration with the user's help. Implemented in `daemon`. Called on the
/// pages' thread; every call returns at once.
class SetupApi {
 public:
  virtual ~SetupApi() = default;
  /// @return it is the secret of this start. Takes the same time for every wrong one.
  [[nodiscard]] virtual bool admits(std::string_view secret) const = 0;
  /// The state for the page, JSON; never nullptr.
  [[nodiscard]] virtual std::shared_ptr<const std::string> state() const = 0;
  /// The newest image of the camera, JPEG; made while requested. @return nullptr: none yet
  [[nodiscard]] virtual std::shared_ptr<const std::string> picture() = 0;
  /// Runs later; the result is in the state. @return Error: too many are waiting
  virtual Expected<void> command(Requester by, std::string what,
                                 std::map<std::string, std::string> values) = 0;
  /// For the audit log: a request with a wrong secret.
  virtual void note_refusal(const Requester& by) = 0;
  /// Tags to print, PDF. @param order  `family`, `size_mm`, `paper`
  /// @return Error with what was expected
  [[nodiscard]] virtual Expected<std::string> sheet(
      std::map<std::string, std::string> order) const = 0;
};

}  // namespace fiducap
