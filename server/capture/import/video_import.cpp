#include "capture/import/video_import.hpp"

#include <filesystem>

#include "base/assert.hpp"
#include "base/text.hpp"
#include "capture/import/imu_csv.hpp"
#include "capture/import/parts_source.hpp"

namespace fiducap {
namespace {

// No stamp of a recording is below zero, whatever the offset.
constexpr Duration kVideoBegins = std::chrono::hours(1);
constexpr Duration kSameZero = std::chrono::minutes(1);

class VideoImport final : public ImportSource {
 public:
  VideoImport(std::string path, FoundStream video, const Clock& clock)
      : path_(std::move(path)), clock_(clock) {
    streams_.push_back(std::move(video));
  }

  Expected<void> add_imu(const ImportOptions& options);
  const std::vector<FoundStream>& streams() const override { return streams_; }
  std::vector<std::string> remarks() const override { return remarks_; }
  Expected<std::unique_ptr<SensorSource>> open(const ImportChoice& choice,
                                               const std::vector<CameraMount>& cameras) override {
    std::vector<CameraPart> parts;
    if (!choice.images.empty()) {
      auto video = open_video_file(path_, cameras.front().model, clock_);
      if (!video) return tl::unexpected(video.error());
      parts.push_back({{}, std::move(*video), begins_});
    }
    return make_parts_source(choice.imu ? imu_ : std::vector<ImuSample>{}, std::move(parts),
                             cameras);
  }

 private:
  std::string path_;
  const Clock& clock_;
  std::vector<FoundStream> streams_;
  std::vector<std::string> remarks_;
  std::vector<ImuSample> imu_;
  Duration begins_{kVideoBegins};
};

Expected<void> VideoImport::add_imu(const ImportOptions& options) {
  auto table = read_imu_csv(options.imu_csv, options);
  if (!table) return tl::unexpected(table.error());
  imu_ = std::move(table->samples);
  remarks_ = std::move(table->remarks);
  const Duration first = imu_.front().sampled_at.time_since_epoch();
  const bool same_zero = std::chrono::abs(first) <= kSameZero;
  // Stamps of the time of day stay as they are; the video is put beside them.
  const bool keeps = first > kVideoBegins;
  const Duration moved = keeps ? Duration{0} : same_zero ? kVideoBegins : kVideoBegins - first;
  begins_ = keeps ? first : kVideoBegins;
  for (ImuSample& sample : imu_) sample.sampled_at += moved + options.imu_offset;
  remarks_.push_back(std::string(same_zero ? "the table's time counts from the video's first image"
                                           : "the table's first reading is put at the video's "
                                             "first image") +
                     (options.imu_offset == Duration{0}
                          ? ": where that is not so, --imu-offset moves it"
                          : ", moved by " + fixed(to_seconds(options.imu_offset), 4) + " s"));
  FoundStream found = std::move(table->found);
  found.first_ns = to_ns(imu_.front().sampled_at);
  found.last_ns = to_ns(imu_.back().sampled_at);
  streams_.push_back(std::move(found));
  return {};
}

}  // namespace

Expected<FoundStream> look_at_video(const std::string& path, const Clock& clock) {
  auto video = open_video_file(path, {}, clock);
  if (!video) return tl::unexpected(video.error());
  const auto first = (*video)->next({});
  if (!first) return tl::unexpected(first.error());
  if (!*first) return fail(ErrorCode::kInvalid, "has no image that can be decoded", path);
  const auto& image = *std::get<CameraFrame>(**first).image;
  FoundStream found;
  found.name = std::filesystem::path(path).filename().string();
  found.type = "video";
  found.mount.model.width = image.width;
  found.mount.model.height = image.height;
  found.lens_fault = "a video does not tell its lens";
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
  auto source = std::make_unique<VideoImport>(path, std::move(*video), *options.clock);
  if (!options.imu_csv.empty())
    if (const auto added = source->add_imu(options); !added) return tl::unexpected(added.error());
  return source;
}

}  // namespace fiducap
