// What a recording says about itself. The first byte chooses the file: camera, IMU, tags, true
// places of the cameras.
#include "fuzz/recording_stage.hpp"

namespace {

using namespace fiducap;

/// A sound recording in which one file is the input.
struct Stage : fuzz::RecordingStage {
  explicit Stage(unsigned which) {
    const auto put = [&](bool ours, const std::filesystem::path& path, const std::string& sound) {
      ours ? link(path, file) : write(path, sound);
    };
    put(which == 0, layout().camera_yaml(0), camera_yaml(info().cameras[0]));
    if (which == 1) link(layout().imu_yaml(), file), write(layout().imu_csv(), "#\n");
    if (which == 2) link(layout().tags_yaml(), file);
    if (which == 3) link(layout().truth_extrinsics_yaml(), file);
  }
  fuzz::MemoryFile file;
};

void check(const RecordingInfo& info) {
  fuzz::require(info.cameras.size() == 1 && info.cameras[0].model.check().empty());
  fuzz::require(info.tag_size_m > 0);
  for (const RecordedTag& tag : info.known_tags) fuzz::require(tag.edge_m > 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::array<Stage, 4> stages{Stage(0), Stage(1), Stage(2), Stage(3)};
  const fuzz::Chosen input(data, size, 4);
  const Stage& stage = stages[input.which];
  stage.file.put(input.bytes);
  if (input.which == 3) {
    (void)read_truth_extrinsics(stage.folder());
  } else if (const auto info = read_recording_info(stage.folder())) {
    check(*info);
  }
  return 0;
}
