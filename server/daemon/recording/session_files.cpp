#include "daemon/recording/session_files.hpp"

#include <utility>

#include "capture/recording/output_file.hpp"
#include "mapping/formats/map_yaml.hpp"

namespace fiducap {

namespace fs = std::filesystem;

Expected<SessionFiles> SessionFiles::create(const fs::path& folder,
                                            const std::vector<RecordedBody>& bodies,
                                            const SessionStart& start) {
  std::error_code error;
  if (fs::exists(folder, error))
    return fail(ErrorCode::kInvalid, "there is a recording of this name; nothing is overwritten",
                folder.string());
  SessionFiles files(bodies);
  for (const RecordedBody& body : bodies) {
    if (auto done = files.open_body(folder, body); !done) return tl::unexpected(done.error());
  }
  if (auto done = files.open_surroundings(folder, start); !done)
    return tl::unexpected(done.error());
  return files;
}

Expected<void> SessionFiles::open_body(const fs::path& folder, const RecordedBody& body) {
  RecordingInfo info = body.info;
  info.folder = (folder / info.name).string();
  auto writer = RecordingWriter::create(info);
  if (!writer) return tl::unexpected(writer.error());
  if (body.truth.at) {
    if (auto done = writer->write_truth_tags(body.truth.tags); !done) return done;
    if (auto done = writer->write_truth_extrinsics(body.truth.X_BV); !done) return done;
  }
  writers_.push_back(std::move(*writer));
  return {};
}

Expected<void> SessionFiles::open_surroundings(const fs::path& folder, const SessionStart& start) {
  if (!start.map) return {};
  first_revision_ = start.map->revision;
  for (const auto& [name, text] :
       {std::pair<const char*, std::string>{"map.yaml", map_to_yaml(*start.map->map)},
        {"config.yaml", start.config_yaml}}) {
    const auto written = write_output_file(folder / name, text);
    if (!written) return tl::unexpected(written.error());
    surroundings_bytes_ += *written;
  }
  auto turns = MapTurnWriter::create(folder / "turns.csv");
  if (!turns) return tl::unexpected(turns.error());
  turns_ = std::move(*turns);
  if (!start.is_refined) return {};
  auto refinements = RefinementTurnWriter::create(folder / "refinements.csv");
  if (!refinements) return tl::unexpected(refinements.error());
  refinements_ = std::move(*refinements);
  return {};
}

Expected<void> SessionFiles::write(std::size_t body, const SensorSample& sample) {
  return writers_.at(body).write(sample);
}

Expected<void> SessionFiles::write(MapTurn turn) {
  if (!turns_) return {};
  turn.revision -= static_cast<std::int64_t>(first_revision_);
  if (const auto& truth = bodies_.get().at(turn.body).truth.at) {
    const auto done = writers_.at(turn.body).write_truth(truth(instant_from_ns(turn.stamp_ns)));
    if (!done) return done;
  }
  return turns_->write(turn);
}

Expected<void> SessionFiles::write(const RefinementTurn& turn) {
  return refinements_ ? refinements_->write(turn) : Expected<void>{};
}

Expected<void> SessionFiles::flush() {
  Expected<void> all = turns_ ? turns_->flush() : Expected<void>{};
  if (refinements_) {
    if (auto done = refinements_->flush(); !done && all) all = std::move(done);
  }
  for (RecordingWriter& writer : writers_) {
    if (auto done = writer.flush(); !done && all) all = std::move(done);
  }
  return all;
}

Expected<void> SessionFiles::close() {
  Expected<void> all = turns_ ? turns_->close() : Expected<void>{};
  if (refinements_) {
    if (auto done = refinements_->close(); !done && all) all = std::move(done);
  }
  for (RecordingWriter& writer : writers_) {
    if (auto done = writer.finish(); !done && all) all = std::move(done);
  }
  return all;
}

std::uint64_t SessionFiles::bytes() const {
  std::uint64_t all = surroundings_bytes_ + (turns_ ? turns_->bytes() : 0) +
                      (refinements_ ? refinements_->bytes() : 0);
  for (const RecordingWriter& writer : writers_) all += writer.bytes();
  return all;
}

}  // namespace fiducap
