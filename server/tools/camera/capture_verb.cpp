#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <string_view>
#include <vector>

#include <poll.h>
#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "base/numeric.hpp"
#include "base/text.hpp"
#include "capture/gray_image.hpp"
#include "capture/image_watch.hpp"
#include "capture/lens/calibration_files.hpp"
#include "capture/recording/recording_writer.hpp"
#include "daemon/system.hpp"
#include "detection/no_tag.hpp"
#include "detection/tag_detector.hpp"
#include "tools/camera/camera_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

constexpr double kLeastSide = 20;            // px, as `calibrate camera` requires
constexpr int kQuicklySearched = 800 * 600;  // larger images in every second pixel
constexpr double kSharp = 0.5;               // ImageTraits; the same as ImageWatch's
constexpr double kFarApart = 0.05;           // of the image width, mean over shared corners

bool is_large(const TagSighting& tag) {
  for (std::size_t i = 0; i < 4; ++i)
    if (!((tag.corners_px[i] - tag.corners_px[(i + 1) % 4]).norm() >= kLeastSide)) return false;
  return true;
}

/// Chooses the images of a live camera that improve a calibration: sharp, with tags that are large
/// enough, and different from the images chosen before.
class PicturePicker final {
 public:
  enum class Verdict { kTaken, kNoTag, kSmeared, kSimilar };

  /// @pre tags.check().empty()
  explicit PicturePicker(const TagSetConfig& tags) : tags_(tags) {}

  /// kTaken: the image is remembered as chosen.
  [[nodiscard]] Verdict look(const CameraFrame& frame) {
    const ImageTraits measures = traits_of(*frame.image);
    const auto is_smeared = [](double sharpness) { return sharpness > 0 && sharpness < kSharp; };
    if (is_smeared(measures.across) || is_smeared(measures.down)) return Verdict::kSmeared;
    Corners corners = corners_in(frame);
    if (corners.empty()) return Verdict::kNoTag;
    for (const Corners& before : taken_) {
      double sum = 0;
      int count = 0;
      for (const auto& [id, now] : corners) {
        const auto then = before.find(id);
        if (then == before.end()) continue;
        for (std::size_t i = 0; i < 4; ++i) sum += (now[i] - then->second[i]).norm();
        count += 4;
      }
      if (count > 0 && sum / count < kFarApart * frame.image->width) return Verdict::kSimilar;
    }
    taken_.push_back(std::move(corners));
    return Verdict::kTaken;
  }

 private:
  using Corners = std::map<int, std::array<Eigen::Vector2d, 4>>;

  [[nodiscard]] Corners corners_in(const CameraFrame& frame) {
    if (!detector_) {
      DetectorConfig config;
      config.decimate = frame.image->width * frame.image->height > kQuicklySearched ? 2.0 : 1.0;
      detector_.emplace(tags_, config);
    }
    Corners corners;
    for (const TagSighting& tag : detector_->detect(frame).tags)
      if (is_large(tag)) corners[tag.tag_id] = tag.corners_px;
    return corners;
  }

  TagSetConfig tags_;
  std::optional<TagDetector> detector_;
  std::vector<Corners> taken_;
};

/// For the person who moves the camera; of each verdict.
constexpr std::array<std::string_view, 4> kAdvice{
    "taken; now from another side, distance or angle",
    "no tag with sides of 20 px: nearer, more light, or another --family?",
    "not sharp: hold still for a moment",
    "like one that was taken: move on, turn, tilt, fill the corners of the image"};

namespace fs = std::filesystem;

const SystemClock kCaptureClock;  // outlives the sources

/// Whether a line was typed since the last call.
bool enter_was_pressed() {
  pollfd typed{STDIN_FILENO, POLLIN, 0};
  if (::poll(&typed, 1, 0) <= 0 || (typed.revents & POLLIN) == 0) return false;
  std::array<char, 256> line{};
  return ::read(STDIN_FILENO, line.data(), line.size()) > 0;
}

/// Images of the camera, with statistics.
class CameraRun final {
 public:
  CameraRun(std::unique_ptr<SensorSource> source, const Terminal& terminal)
      : source_(std::move(source)), terminal_(terminal) {}

  /// @return nullopt: the file has ended, or the user interrupted
  Expected<std::optional<CameraFrame>> next() {
    while (!interrupted()) {
      auto sample = source_->next({});
      if (!sample) return tl::unexpected(sample.error());
      if (!*sample) return std::nullopt;
      auto* frame = std::get_if<CameraFrame>(&**sample);
      if (frame == nullptr) continue;
      if (images_++ == 0) first_ = frame->exposed_at;
      last_ = frame->exposed_at;
      size_ = {frame->image->width, frame->image->height};
      lost_ += frame->lost_before;
      for (const ImageCondition& doubt : watch_.take(*frame))
        terminal_.err << "camera: " << doubt.text
                      << (doubt.remedy.empty() ? "" : ". " + doubt.remedy) << "\n";
      return std::move(*frame);
    }
    return std::nullopt;
  }
  [[nodiscard]] Duration length() const { return last_ - first_; }
  [[nodiscard]] nlohmann::ordered_json json() const {
    return {{"size", {size_.width, size_.height}},
            {"images_seen", images_},
            {"images_lost", lost_},
            {"seconds", to_seconds(length())},
            {"rate_hz", rate_hz()}};
  }
  [[nodiscard]] std::string text() const {
    return size_text(size_) + ", " + fixed(rate_hz(), 1) + " Hz" +
           (lost_ > 0 ? ", " + std::to_string(lost_) + " images lost" : "");
  }

 private:
  [[nodiscard]] double rate_hz() const {
    return length() > Duration{0} ? static_cast<double>(images_ - 1) / to_seconds(length()) : 0;
  }

  std::unique_ptr<SensorSource> source_;
  const Terminal& terminal_;
  ImageWatch watch_{{}};
  std::uint64_t images_{0};
  std::uint64_t lost_{0};
  PixelSize size_{};
  Instant first_{}, last_{};
};

/// Decides when a picture is taken.
class Shutter final {
 public:
  explicit Shutter(const CaptureArguments& arguments) : every_s_(arguments.every_s) {
    by_key_ = !arguments.tags && every_s_ <= 0 && ::isatty(STDIN_FILENO) == 1;
    if (arguments.tags) {
      TagSetConfig tags;
      tags.family = arguments.family;
      picker_.emplace(tags);
      no_tag_.emplace(tags);
    } else if (every_s_ <= 0) {
      every_s_ = 1;
    }
  }
  bool releases(const CameraFrame& frame) {
    if (by_key_) return enter_was_pressed();
    if (last_ && to_seconds(frame.exposed_at - *last_) < every_s_) return false;
    if (picker_) {
      const auto verdict = picker_->look(frame);
      advice_ = kAdvice[static_cast<std::size_t>(verdict)];
      no_tag_->note(frame.image, verdict != PicturePicker::Verdict::kNoTag);
      if (!no_tag_->why().empty()) advice_ = no_tag_->why();
      if (verdict != PicturePicker::Verdict::kTaken) return false;
    }
    last_ = frame.exposed_at;
    return true;
  }
  [[nodiscard]] std::string hint() const {
    if (by_key_) return "Enter takes one, Ctrl-C ends";
    return advice_.empty() ? "one every " + shortest(every_s_) + " s" : std::string(advice_);
  }

 private:
  double every_s_;
  bool by_key_{false};
  std::optional<PicturePicker> picker_;
  std::optional<Instant> last_;
  std::string_view advice_;
  std::optional<NoTagAdvice> no_tag_;
};

Expected<void> make_new_folder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return fail(ErrorCode::kUnavailable, "cannot be made: " + error.message(), folder);
  if (fs::is_empty(folder, error) && !error) return {};
  return fail(ErrorCode::kInvalid, "has content already: name a new folder", folder);
}

/// @return how many pictures were taken
Expected<int> take_pictures(const CaptureArguments& arguments, CameraRun& run,
                            const Terminal& terminal) {
  if (auto made = make_new_folder(arguments.out); !made) return tl::unexpected(made.error());
  Shutter shutter(arguments);
  ProgressLine line(terminal);
  std::vector<std::uint8_t> scratch;
  int taken = 0;
  while (taken < arguments.pictures) {
    const auto frame = run.next();
    if (!frame) return tl::unexpected(frame.error());
    if (!*frame) break;
    if (shutter.releases(**frame)) {
      const auto file = fs::path(arguments.out) / fmt::format("picture_{:04}.png", ++taken);
      const auto written = write_gray_file(file, scratch, *(*frame)->image);
      if (!written) return tl::unexpected(written.error());
    }
    line.show(std::to_string(taken) + " of " + std::to_string(arguments.pictures) +
              " pictures: " + shutter.hint());
  }
  return taken;
}

/// A guessed lens of 70°, common among cameras, with its sigmas.
CameraMount guessed_mount(PixelSize size) {
  CameraMount mount;
  const double f = size.width / 2.0 / std::tan(35 * kDegree);
  mount.model = {
      size.width,        size.height, f, f, (size.width - 1) / 2.0, (size.height - 1) / 2.0,
      Distortion::kNone, {}};
  mount.focal_sigma = 0.1;
  mount.centre_sigma_px = 20;
  mount.k1_sigma = 0.1;
  return mount;
}

/// @return how many images were recorded
Expected<int> record(const CaptureArguments& arguments, const CameraModel& lens, CameraRun& run,
                     const Terminal& terminal) {
  std::optional<RecordingWriter> writer;
  ProgressLine line(terminal);
  int images = 0;
  while (to_seconds(run.length()) < arguments.seconds) {
    const auto frame = run.next();
    if (!frame) return tl::unexpected(frame.error());
    if (!*frame) break;
    if (!writer) {
      RecordingInfo info;
      info.folder = arguments.out;
      info.name = fs::path(arguments.out).filename().string();
      if (lens.width > 0)
        info.cameras.emplace_back().model = lens;
      else
        info.cameras = {guessed_mount({(*frame)->image->width, (*frame)->image->height})};
      info.has_images = {true};
      info.has_corners = {false};
      info.tag_family = arguments.family;
      auto created = RecordingWriter::create(info);
      if (!created) return tl::unexpected(created.error());
      writer.emplace(std::move(*created));
    }
    if (const auto written = writer->write(**frame); !written)
      return tl::unexpected(written.error());
    ++images;
    line.show("recording: " + fixed(to_seconds(run.length()), 1) + " of " +
              shortest(arguments.seconds) + " s, " + std::to_string(images) + " images");
  }
  if (!writer) return 0;
  if (const auto finished = writer->finish(); !finished) return tl::unexpected(finished.error());
  return images;
}

void add_camera_options(CLI::App& verb, CameraDeviceConfig& camera) {
  verb.add_option("--camera", camera.open,
                  "/dev/videoN or N, a name of /dev/v4l/by-id, libcamera:, rtsp://…, a GStreamer "
                  "pipeline or a video")
      ->required();
  verb.add_option("--width", camera.width, "Asked of the camera; with --height");
  verb.add_option("--height", camera.height, "Asked of the camera; with --width");
  add_positive(verb, "--rate", camera.rate_hz, "Images a second asked of the camera");
  verb.add_option("--format", camera.format, "GREY, MJPEG, YUYV, …; auto: the quickest")
      ->capture_default_str();
  add_positive(verb, "--exposure", camera.exposure_s, "Seconds; else as it is");
  verb.add_option("--gain", camera.gain, "auto, or a number of the camera")->capture_default_str();
  verb.add_option("--focus", camera.focus, "auto, or a number of the camera")
      ->capture_default_str();
}

}  // namespace

int run_capture(const CaptureArguments& arguments, const Terminal& terminal,
                const CameraOpener& open) {
  if ((arguments.pictures > 0) == (arguments.seconds > 0))
    return report(terminal, {ErrorCode::kInvalid, "needs either --pictures N or --seconds S", {}});
  if (const auto faults = arguments.camera.check("--"); !faults.empty())
    return report(terminal, {ErrorCode::kInvalid, faults.front().text(), {}});
  TagSetConfig tags;
  tags.family = arguments.family;
  if (const auto faults = tags.check(); !faults.empty())
    return report(terminal, {ErrorCode::kInvalid, faults.front().text(), "--family"});
  const bool has_lens = !arguments.calibration.empty();
  const auto lens = has_lens ? read_camera_calibration(arguments.calibration) : CameraModel{};
  if (!lens) return report(terminal, lens.error());
  catch_interrupt();
  if (!arguments.json && terminal.err_is_live) log::set_level(log::Level::kInfo);
  auto source = open ? open(arguments.camera, *lens)
                     : open_camera_device(arguments.camera, *lens, kCaptureClock);
  if (!source) return report(terminal, source.error());
  CameraRun run(std::move(*source), terminal);
  const bool takes_pictures = arguments.pictures > 0;
  const auto taken = takes_pictures ? take_pictures(arguments, run, terminal)
                                    : record(arguments, *lens, run, terminal);
  if (!taken) return report(terminal, taken.error());
  if (*taken == 0)
    return report(terminal, {ErrorCode::kNotFound, "nothing was taken", arguments.out});
  if (arguments.json) {
    nlohmann::ordered_json all{{"camera", arguments.camera.open}, {"out", arguments.out}};
    all[takes_pictures ? "pictures" : "images"] = *taken;
    all.update(run.json());
    return print_json(terminal, all);
  }
  terminal.out << arguments.out << ": " << *taken << (takes_pictures ? " pictures" : " images")
               << " (" << run.text() << ")\n  fiducap "
               << (takes_pictures ? "calibrate camera " + arguments.out + " --out lens\n"
                                  : "check " + arguments.out + "\n");
  if (!takes_pictures && !has_lens)
    terminal.out << "  its lens is a guess: --calibration names a better one\n";
  return kExitOk;
}

void add_capture(CLI::App& app, ChosenVerb& chosen) {
  auto* verb =
      app.add_subcommand("capture", "Take pictures for a calibration, or a recording with images");
  auto& a = arguments_of<CaptureArguments>(*verb, chosen, [](const auto& arguments, const auto& t) {
    return run_capture(arguments, t);
  });
  add_camera_options(*verb, a.camera);
  verb->add_option("--out", a.out, "New folder")->required();
  auto* pictures =
      verb->add_option("--pictures", a.pictures,
                       "Number of pictures; each on Enter, without a terminal once a second")
          ->check(kPositive);
  add_positive(*verb, "--seconds", a.seconds, "Length of a recording")->excludes(pictures);
  add_positive(*verb, "--every", a.every_s, "Seconds between two pictures");
  verb->add_flag("--tags", a.tags,
                 "Take pictures by itself: those with tags that are sharp and differ");
  verb->add_option("--family", a.family, "Tag family")->capture_default_str();
  verb->add_option("--calibration", a.calibration,
                   "Of the lens, for a recording; without it the lens is a guess");
  verb->add_flag("--json", a.json, "What was taken, for scripts");
  verb->footer(
      "For a calibration: a sheet of tags (fiducap tags sheet) on a flat wall, the camera moved "
      "around it, near and far, tilted, until tags were in every corner of the image.\n"
      "Example:\n  fiducap capture --camera 0 --out lens_pictures --pictures 40 --tags\n"
      "  fiducap calibrate camera lens_pictures --out lens\n"
      "  fiducap capture --camera 0 --out recordings/hall --seconds 30 --calibration "
      "lens/camera.yaml");
}

}  // namespace fiducap
