#include "daemon/recording/session_files.hpp"

#include <exception>

#include "base/log.hpp"
#include "capture/output_file.hpp"
#include "mapping/formats/map_format.hpp"

namespace fiducap {

namespace fs = std::filesystem;

Expected<SessionFiles> SessionFiles::create(const fs::path& folder,
                                            const std::vector<RecordedBody>& bodies,
                                            const SessionStart& start) {
  std::error_code error;
  if (fs::exists(folder, error))
    return fail(ErrorCode::kInvalid, "a recording of this name exists; nothing is overwritten",
                folder.string());
  SessionFiles files(bodies);
  for (const RecordedBody& body : bodies)
    if (auto done = files.open_body(folder, body); !done) return tl::unexpected(done.error());
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
  auto turns = TurnWriter<MapTurn>::create(folder / "turns.csv");
  if (!turns) return tl::unexpected(turns.error());
  turns_ = std::move(*turns);
  auto refinements = TurnWriter<RefinementTurn>::create(folder / "refinements.csv");
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
  const auto note = [&](Expected<void> done) {
    if (!done && all) all = std::move(done);
  };
  if (refinements_) note(refinements_->flush());
  for (RecordingWriter& writer : writers_) note(writer.flush());
  return all;
}

Expected<void> SessionFiles::close() {
  Expected<void> all = turns_ ? turns_->close() : Expected<void>{};
  const auto note = [&](Expected<void> done) {
    if (!done && all) all = std::move(done);
  };
  if (refinements_) note(refinements_->close());
  for (RecordingWriter& writer : writers_) note(writer.finish());
  return all;
}

std::uint64_t SessionFiles::bytes() const {
  std::uint64_t all = surroundings_bytes_ + (turns_ ? turns_->bytes() : 0) +
                      (refinements_ ? refinements_->bytes() : 0);
  for (const RecordingWriter& writer : writers_) all += writer.bytes();
  return all;
}

namespace {

constexpr Duration kFlushPeriod = std::chrono::seconds(1);
constexpr const char* kFailing = "failing";

}  // namespace

void SessionWriter::write(const RecordedItem& item) noexcept {
  log::guarded(
      kRecorder, [&] { return item.session->name(); },
      [&] {
        Expected<void> done;
        try {
          done = carry_out(item);
        } catch (const std::exception& failure) {
          done = fail(ErrorCode::kUnavailable, failure.what());
        }
        if (!done) give_up(*item.session, done.error());
      });
}

Expected<void> SessionWriter::carry_out(const RecordedItem& item) {
  if (const auto* start = std::get_if<SessionStart>(&item.what)) return open(item.session, *start);
  const bool is_end = std::holds_alternative<SessionEnd>(item.what);
  if (item.session != session_) {  // failed
    if (!is_end) item.session->drop();
    return {};
  }
  if (is_end) return finish();
  if (const auto* turn = std::get_if<MapTurn>(&item.what)) return files_->write(*turn);
  if (const auto* turn = std::get_if<RefinementTurn>(&item.what)) return files_->write(*turn);
  auto done = files_->write(item.body, std::get<SensorSample>(item.what));
  if (done) ++written_;
  if (done || done.error().code != ErrorCode::kInvalid) return done;
  item.session->drop();  // the sample is wrong, not the disk
  log::warning(kRecorder, "a sample is left out: " + done.error().text());
  return {};
}

Expected<void> SessionWriter::open(const std::shared_ptr<RecordedSession>& session,
                                   const SessionStart& start) {
  const auto folder = folder_ / session->name();
  auto files = SessionFiles::create(folder, bodies_, start);
  if (!files) return tl::unexpected(files.error());
  files_ = std::move(*files);
  session_ = session;
  session_->opened();
  written_ = 0;
  flushed_at_ = clock_.now();
  log::info(kRecorder, "recording to " + folder.string());
  failing_ = false;
  events_.end(kRecorder, kFailing, "recordings are written again");
  return {};
}

Expected<void> SessionWriter::finish() {
  if (auto closed = files_->close(); !closed) return closed;
  session_->on_disk(written_, files_->bytes());
  files_.reset();
  const auto session = std::exchange(session_, nullptr);
  session->finished();
  // Exceptions from here on do not make it fail.
  log::guarded(
      kRecorder, [] { return "reporting the end of a recording"; },
      [&] {
        log::info(kRecorder, "the recording \"" + session->name() +
                                 "\" has ended: " + session->status().counts());
      });
  return {};
}

void SessionWriter::flush_when_due() noexcept {
  if (!files_ || clock_.now() - flushed_at_ < kFlushPeriod) return;
  const auto session = session_;
  log::guarded(
      kRecorder, [&] { return session->name(); },
      [&] {
        const auto flushed = files_->flush();
        flushed_at_ = clock_.now();
        if (!flushed) return give_up(*session, flushed.error());
        session->on_disk(written_, files_->bytes());
      });
}

void SessionWriter::give_up(RecordedSession& session, const Error& why) {
  if (session_.get() == &session) {
    if (files_) {
      static_cast<void>(files_->close());  // flushes the files that did not fail
      session.on_disk(files_->bytes());
    }
    files_.reset();
    session_ = nullptr;
  }
  session.failed(why.text());
  const std::string text = "the recording \"" + session.name() + "\" has failed: " + why.text() +
                           " (" + session.status().counts() + ")";
  // The event board reports a condition once, but this is another recording.
  if (std::exchange(failing_, true)) log::error(kRecorder, text);
  events_.begin({.severity = Severity::kError,
                 .subject = kRecorder,
                 .kind = kFailing,
                 .text = text,
                 .remedy =
                     "Fix the problem (or choose another name, or another `recorder.folder`), "
                     "then start a recording"});
}

}  // namespace fiducap
