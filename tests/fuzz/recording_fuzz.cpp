// Recordings. The first byte of an input chooses the file.
#include <array>
#include <filesystem>
#include <string>

#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"
#include "capture/recording/recording_source.hpp"
#include "fuzz/memory_file.hpp"
#include "pipeline/replay/map_turns.hpp"
#include "support/temporary_folder.hpp"

namespace {

/// A recording with one camera; `link` puts a file in memory into the layout.
class RecordingStage {
 public:
  RecordingStage() {
    std::filesystem::create_directories(layout_.mav());
    info_.folder = folder_.text();
    CameraMount camera;
    camera.model = {8, 6, 8, 8, 3.5, 2.5, Distortion::kNone, {}};
    info_.cameras = {camera};
    info_.has_images = {false};
    info_.has_corners = {true};
    info_.imu = ImuNoise{};
  }

  [[nodiscard]] const RecordingLayout& layout() const { return layout_; }
  [[nodiscard]] RecordingInfo& info() { return info_; }
  [[nodiscard]] std::string folder() const { return folder_.text(); }
  void write(const std::filesystem::path& path, std::string_view text) const {
    folder_.write(path.lexically_relative(folder_.path()).string(), text);
  }
  void link(const std::filesystem::path& path, const MemoryFile& file) const {
    std::filesystem::create_directories(path.parent_path());
    std::filesystem::create_symlink(file.path(), path);
  }

 private:
  TemporaryFolder folder_;
  RecordingLayout layout_{folder_.path()};
  RecordingInfo info_;
};

/// A sound recording in which one file is the input.
struct YamlStage : RecordingStage {
  explicit YamlStage(unsigned which) {
    const auto put = [&](bool ours, const std::filesystem::path& path, const std::string& sound) {
      ours ? link(path, file) : write(path, sound);
    };
    put(which == 0, layout().camera_yaml(0), camera_yaml(info().cameras[0]));
    if (which == 1) link(layout().imu_yaml(), file), write(layout().imu_csv(), "#\n");
    if (which == 2) link(layout().tags_yaml(), file);
    if (which == 3) link(layout().truth_extrinsics_yaml(), file);
  }
  MemoryFile file;
};

void check_info(const RecordingInfo& info) {
  require(info.cameras.size() == 1 && info.cameras[0].model.check().empty());
  require(info.tag_size_m > 0);
  for (const RecordedTag& tag : info.known_tags) require(tag.edge_m > 0);
}

struct CsvStage : RecordingStage {
  CsvStage() {
    link(layout().imu_csv(), file);
    link(layout().corners_csv(0), file);
    link(layout().frames_csv(0), more);
    link(layout().images_csv(0), file);
    std::filesystem::create_directories(layout().images(0));
    link(layout().state_csv(), file);
    link(layout().truth_tags_csv(), file);
    link(layout().reference_poses_csv(), file);
    link(layout().folder() / "turns.csv", file);
    link(layout().folder() / "refinements.csv", file);
  }
  MemoryFile file, more;
  GrayImagePool pool;
};

/// A stream has no more samples than lines, with valid stamps.
template <typename Stream>
void drain(Expected<Stream> stream, std::size_t bytes) {
  require(stream.has_value());
  std::size_t samples = 0;
  while (const auto sample = stream->next()) {
    require(++samples <= bytes);
    require(to_ns(time_of(*sample)) >= 0);
  }
  stream->log_damage();
}

void require_increasing(const Expected<std::vector<TruthSample>>& truth) {
  if (!truth) return;
  for (std::size_t i = 1; i < truth->size(); ++i) require((*truth)[i].at > (*truth)[i - 1].at);
}

}  // namespace

// Descriptions: camera, IMU, tags, true poses of the cameras.
FUZZ(recording_yaml_fuzz, input) {
  static const std::array<YamlStage, 4> stages{YamlStage(0), YamlStage(1), YamlStage(2),
                                               YamlStage(3)};
  const unsigned which = input.choose(4);
  const YamlStage& stage = stages[which];
  stage.file.put(input.bytes);
  if (which == 3) {
    (void)read_truth_extrinsics(stage.folder());
  } else if (const auto info = read_recording_info(stage.folder())) {
    check_info(*info);
  }
}

// Tables, and a session's turns. For corners a line `---` ends them and begins the list of images.
FUZZ(recording_csv_fuzz, input) {
  static CsvStage stage;
  const unsigned which = input.choose(7);
  const std::string text = input.text();
  const std::size_t cut = std::min(text.find("---\n"), text.size());
  stage.file.put(std::string_view(text).substr(0, cut));
  stage.more.put(std::string_view(text).substr(cut));
  switch (which) {
    case 0:
      drain(ImuStream::open(stage.layout(), stage.info()), text.size());
      break;
    case 1:
      drain(CornerStream::open(stage.layout(), stage.info(), 0), text.size());
      break;
    case 2:
      drain(ImageStream::open(stage.layout(), stage.info(), 0, stage.pool), text.size());
      break;
    case 3:
      require_increasing(read_truth(stage.folder()));
      break;
    case 4:
      require_increasing(read_reference_poses(stage.folder()));
      break;
    case 5:
      (void)read_truth_tags(stage.folder());
      break;
    default:
      if (const auto turns = read_map_turns(stage.layout().folder() / "turns.csv")) {
        for (std::size_t i = 1; i < turns->size(); ++i)
          require((*turns)[i].turn >= (*turns)[i - 1].turn);
      }
      if (const auto turns = read_refinement_turns(stage.layout().folder() / "refinements.csv")) {
        for (const RefinementTurn& turn : *turns)
          require(!turn.adopted || *turn.adopted >= turn.taken);
      }
  }
}
