// The tables of a recording, and a session's turns. The first byte chooses the table; for corners a
// line `---` ends them and begins the list of images.
#include "capture/recording/recording_source.hpp"
#include "fuzz/recording_stage.hpp"
#include "pipeline/replay/map_turns.hpp"

namespace {

using namespace fiducap;

struct Stage : fuzz::RecordingStage {
  Stage() {
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
  fuzz::MemoryFile file, more;
  GrayImagePool pool;
};

/// What a stream gives is no more than its lines, and comes with sound stamps.
template <typename Stream>
void drain(Expected<Stream> stream, std::size_t bytes) {
  fuzz::require(stream.has_value());
  std::size_t samples = 0;
  while (const auto sample = stream->next()) {
    fuzz::require(++samples <= bytes);
    fuzz::require(to_ns(time_of(*sample)) >= 0);
  }
  stream->log_damage();
}

void increasing(const Expected<std::vector<TruthSample>>& truth) {
  if (!truth) return;
  for (std::size_t i = 1; i < truth->size(); ++i)
    fuzz::require((*truth)[i].at > (*truth)[i - 1].at);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Stage stage;
  const fuzz::Chosen input(data, size, 7);
  const std::string text = input.text();
  const std::size_t cut = std::min(text.find("---\n"), text.size());
  stage.file.put(std::string_view(text).substr(0, cut));
  stage.more.put(std::string_view(text).substr(cut));
  switch (input.which) {
    case 0:
      drain(ImuStream::open(stage.layout(), stage.info()), size);
      break;
    case 1:
      drain(CornerStream::open(stage.layout(), stage.info(), 0), size);
      break;
    case 2:
      drain(ImageStream::open(stage.layout(), stage.info(), 0, stage.pool), size);
      break;
    case 3:
      increasing(read_truth(stage.folder()));
      break;
    case 4:
      increasing(read_reference_poses(stage.folder()));
      break;
    case 5:
      (void)read_truth_tags(stage.folder());
      break;
    default:
      if (const auto turns = read_map_turns(stage.layout().folder() / "turns.csv")) {
        for (std::size_t i = 1; i < turns->size(); ++i)
          fuzz::require((*turns)[i].turn >= (*turns)[i - 1].turn);
      }
      if (const auto turns = read_refinement_turns(stage.layout().folder() / "refinements.csv")) {
        for (const RefinementTurn& turn : *turns)
          fuzz::require(!turn.adopted || *turn.adopted >= turn.taken);
      }
  }
  return 0;
}
