#include "tools/calibrate/calibration_views.hpp"

#include <utility>

namespace fiducap {
namespace {

std::string size_text(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

}  // namespace

Expected<CollectedViews> collect_views(
    CalibrationImages& images, const CalibrationTargets& targets,
    const std::function<void(std::size_t, std::size_t)>& progress) {
  ViewCollector collector(targets);
  CollectedViews out;
  CalibrationData& data = out.data;
  for (;;) {
    const auto image = images.next();
    if (!image) return tl::unexpected(image.error());
    if (!*image) break;
    if (out.images++ == 0) {
      data.width = (*image)->width;
      data.height = (*image)->height;
    } else if ((*image)->width != data.width || (*image)->height != data.height) {
      return fail(ErrorCode::kInvalid,
                  (*image)->name + " is " + size_text((*image)->width, (*image)->height) +
                      ", the images before are " + size_text(data.width, data.height) +
                      ": a calibration is for one size");
    }
    auto view = (*image)->image ? collector.look((*image)->name, (*image)->image)
                                : collector.look((*image)->name, (*image)->corners);
    if (view) data.views.push_back(std::move(*view));
    progress(out.images, data.views.size());
  }
  data.targets = collector.targets();
  return out;
}

}  // namespace fiducap
