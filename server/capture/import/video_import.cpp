#include "capture/import/import_parts.hpp"

#include <filesystem>

#include "base/expected.hpp"
#include "base/text.hpp"
#include "capture/import/imu_csv.hpp"

namespace fiducap {
namespace {

// Stamps of a recording stay positive with any offset.
constexpr Duration kVideoBegins = std::chrono::hours(1);
constexpr Duration kSameZero = std::chrono::minutes(1);

class VideoImport final : public PartsImport {
 public:
  explicit VideoImport(const Clock* clock) : PartsImport(clock) {}

  Expected<void> look(const std::string& path, FoundStream video, const ImportOptions& options) {
    if (options.imu_csv.empty()) {
      add_camera(std::move(video), {{}, path, kVideoBegins});
      return {};
    }
    auto table = read_imu_csv(options.imu_csv, options);
    if (!table) return tl::unexpected(table.error());
    remarks_ = std::move(table->remarks);
    const Duration first = table->samples.front().sampled_at.time_since_epoch();
    const bool same_zero = std::chrono::abs(first) <= kSameZero;
    // Absolute stamps are kept; the video is shifted.
    const bool keeps = first > kVideoBegins;
    const Duration moved = keeps ? Duration{0} : same_zero ? kVideoBegins : kVideoBegins - first;
    add_camera(std::move(video), {{}, path, keeps ? first : kVideoBegins});
    for (ImuSample& sample : table->samples) sample.sampled_at += moved + options.imu_offset;
    remarks_.push_back(
        std::string(same_zero ? "the table's time counts from the video's first image"
                              : "the table's first reading is put at the video's first image") +
        (options.imu_offset == Duration{0}
             ? ": otherwise set --imu-offset"
             : ", shifted by " + fixed(to_seconds(options.imu_offset), 4) + " s"));
    table->found.first_ns = to_ns(table->samples.front().sampled_at);
    table->found.last_ns = to_ns(table->samples.back().sampled_at);
    add_imu(std::move(table->found), std::move(table->samples));
    return {};
  }
};

}  // namespace

Expected<FoundStream> look_at_video(const std::string& path, const Clock& clock) {
  auto video = open_video_file(path, {}, clock);
  if (!video) return tl::unexpected(video.error());
  const auto first = (*video)->next({});
  if (!first) return tl::unexpected(first.error());
  if (!*first) return fail(ErrorCode::kInvalid, "has no decodable image", path);
  const auto& image = *std::get<CameraFrame>(**first).image;
  FoundStream found;
  found.name = std::filesystem::path(path).filename().string();
  found.type = "video";
  found.mount.model.width = image.width;
  found.mount.model.height = image.height;
  found.lens_fault = "a video has no lens data";
  if (const auto second = (*video)->next({}); second && *second) {
    const Duration step = time_of(**second) - time_of(**first);
    if (step > Duration{0}) found.mount.rate_hz = 1 / to_seconds(step);
  }
  return found;
}

Expected<std::unique_ptr<ImportSource>> open_video_import(const std::string& path,
                                                          const ImportOptions& options) {
  FIDUCAP_ASSERT(options.clock != nullptr);
  auto video = look_at_video(path, *options.clock);
  if (!video) return tl::unexpected(video.error());
  auto source = std::make_unique<VideoImport>(options.clock);
  if (const auto looked = source->look(path, std::move(*video), options); !looked)
    return tl::unexpected(looked.error());
  return source;
}

}  // namespace fiducap
