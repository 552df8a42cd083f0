#include "daemon/recording/session_writer.hpp"

#include <exception>
#include <string>
#include <utility>

#include "base/log.hpp"
#include "streaming/net/guard.hpp"

namespace fiducap {

namespace {

constexpr Duration kFlushPeriod = std::chrono::seconds(1);
constexpr const char* kFailing = "failing";

}  // namespace

void SessionWriter::write(const RecordedItem& item) noexcept {
  net::guarded(
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
  if (const auto* begin = std::get_if<SessionBegin>(&item.what))
    return open(item.session, begin->start);
  const bool is_end = std::holds_alternative<SessionEnd>(item.what);
  if (item.session != session_) {  // it has failed
    if (!is_end) item.session->drop();
    return {};
  }
  if (is_end) return finish();
  if (const auto* turn = std::get_if<MapTurn>(&item.what)) return files_->write(*turn);
  if (const auto* turn = std::get_if<RefinementTurn>(&item.what)) return files_->write(*turn);
  auto done = files_->write(item.body, std::get<SensorSample>(item.what));
  if (done) ++written_;
  if (done || done.error().code != ErrorCode::kInvalid) return done;
  item.session->drop();  // the sample's fault, not the disk's
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
  // Nothing that is thrown from here on makes it a failed one.
  net::guarded(
      kRecorder, [] { return "saying that a recording has ended"; },
      [&] {
        log::info(kRecorder, "the recording \"" + session->name() +
                                 "\" has ended: " + session->status().counts());
      });
  return {};
}

void SessionWriter::flush_when_due() noexcept {
  if (!files_ || clock_.now() - flushed_at_ < kFlushPeriod) return;
  const auto session = session_;
  net::guarded(
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
      static_cast<void>(files_->close());  // other files than the failed one take their last second
      session.on_disk(files_->bytes());
    }
    files_.reset();
    session_ = nullptr;
  }
  session.failed(why.text());
  const std::string text = "the recording \"" + session.name() + "\" has failed: " + why.text() +
                           " (" + session.status().counts() + ")";
  // A condition that stands is not told again, but this is another recording.
  if (std::exchange(failing_, true)) log::error(kRecorder, text);
  events_.begin({.severity = Severity::kError,
                 .subject = kRecorder,
                 .kind = kFailing,
                 .text = text,
                 .remedy = "Mend that (or take another name, or another `recorder.folder`), then "
                           "start a recording"});
}

}  // namespace fiducap
