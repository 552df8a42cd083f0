#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "streaming/page_api.hpp"

namespace fiducap {

/// Cameras whose pictures are texts that the test makes.
class FakeViews final : public CameraViews {
 public:
  std::vector<Camera> all{{1, 0, 752, 480, 20}, {1, 1, 640, 400, 20}, {2, 0, 752, 480, 30}};
  std::map<std::size_t, std::optional<ViewRequest>> watched;  ///< The last requests.
  int asked{0};                                               ///< Number of requests.
  std::map<std::size_t, Picture> made;

  void make(std::size_t camera, std::string text) {
    made[camera] = std::make_shared<const std::string>(std::move(text));
  }

  [[nodiscard]] const std::vector<Camera>& cameras() const override { return all; }
  void watch(std::size_t camera, const std::optional<ViewRequest>& request) override {
    watched[camera] = request;
    ++asked;
  }
  [[nodiscard]] Picture take(std::size_t camera) override {
    return std::exchange(made[camera], nullptr);
  }
};

}  // namespace fiducap
