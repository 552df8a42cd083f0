#include "daemon/session_recorder.hpp"

#include <algorithm>
#include <cctype>
#include <exception>
#include <fstream>
#include <utility>

#include "base/log.hpp"
#include "detection/side_bend.hpp"
#include "mapping/formats/map_yaml.hpp"

namespace fiducap {

namespace {

bool is_folder_name(const std::string& name) {
  const auto good = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.' || c == ' ';
  };
  return !name.empty() && name.size() <= 127 && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), good);
}

std::size_t image_bytes(const std::variant<std::monostate, SensorSample, MapTurn>& what) {
  const auto* sample = std::get_if<SensorSample>(&what);
  const auto* frame = sample == nullptr ? nullptr : std::get_if<CameraFrame>(sample);
  return frame == nullptr || !frame->image ? 0 : frame->image->pixels.size();
}

}  // namespace

void SessionRecorder::add_body(const std::string& name, RecordingInfo info, SimulatedTruth truth) {
  info.name = name;
  info.has_images.assign(info.cameras.size(), config_.images);
  info.has_corners.assign(info.cameras.size(), !config_.images);
  bodies_.push_back(std::move(info));
  truths_.push_back(std::move(truth));
}

Expected<void> SessionRecorder::start(const std::string& name) {
  if (const auto running = current())
    return fail(ErrorCode::kUnavailable,
                "the recording \"" + *running + "\" is under way; stop it first");
  if (!is_folder_name(name))
    return fail(ErrorCode::kInvalid,
                "a recording's name must have 1 to 127 of a-z A-Z 0-9 _ - . and space", name);
  auto session = std::make_shared<Session>();
  session->name = name;
  const auto folder =
      std::filesystem::path(config_.folder.empty() ? "recordings" : config_.folder) / name;
  std::error_code error;
  if (std::filesystem::exists(folder, error))
    return fail(ErrorCode::kInvalid, "there is a recording of this name; nothing is overwritten",
                folder.string());
  for (RecordingInfo info : bodies_) {
    info.folder = (folder / info.name).string();
    auto writer = RecordingWriter::create(info);
    if (!writer) return tl::unexpected(writer.error());
    if (const SimulatedTruth& truth = truths_[session->writers.size()]; truth.at) {
      if (auto done = writer->write_truth_tags(truth.tags); !done) return done;
      if (auto done = writer->write_truth_extrinsics(truth.X_BV); !done) return done;
    }
    session->writers.push_back(std::move(*writer));
  }
  if (auto done = write_surroundings(folder, *session); !done) return done;
  const std::lock_guard lock(mutex_);
  session_ = std::move(session);
  recording_ = true;
  log::info("recorder", "recording to " + folder.string());
  return {};
}

Expected<void> SessionRecorder::stop() {
  {
    const std::lock_guard lock(mutex_);
    if (!session_) return fail(ErrorCode::kUnavailable, "no recording is under way");
    recording_ = false;
    waiting_.push_back({std::exchange(session_, nullptr), 0, {}});
  }
  filled_.notify_one();
  return {};
}

std::optional<std::string> SessionRecorder::current() const {
  const std::lock_guard lock(mutex_);
  return session_ ? std::optional(session_->name) : std::nullopt;
}

Expected<void> SessionRecorder::write_surroundings(const std::filesystem::path& folder,
                                                   Session& session) {
  if (!surroundings_.published) return {};
  const MapView view = surroundings_.published();
  session.first_revision = view.revision;
  for (const auto& [name, text] :
       {std::pair<const char*, std::string>{"map.yaml", map_to_yaml(*view.map)},
        {"config.yaml", surroundings_.config_yaml}}) {
    std::ofstream file(folder / name, std::ios::binary);
    file << text;
    file.flush();
    if (!file.good())
      return fail(ErrorCode::kUnavailable, "cannot be written: disk full, or no permission",
                  (folder / name).string());
  }
  auto turns = MapTurnWriter::create(folder / "turns.csv");
  if (!turns) return tl::unexpected(turns.error());
  session.turns = std::move(*turns);
  return {};
}

void SessionRecorder::take(std::size_t body, const SensorSample& sample) {
  if (!recording_) return;
  if (std::holds_alternative<CameraFrame>(sample) && !config_.images) return;
  put(body, sample);
}

void SessionRecorder::take_found(std::size_t body, const CornerFrame& found) {
  if (!recording_ || config_.images) return;
  CornerFrame corners = found;
  const auto camera = static_cast<std::size_t>(found.camera);
  // A recording holds corners as they are, not where straight lines through bent sides meet.
  if (found.fitted_straight_sides && camera < bodies_[body].cameras.size()) {
    for (TagSighting& tag : corners.tags)
      tag.corners_px = unbend_corners(bodies_[body].cameras[camera].model, tag.corners_px);
  }
  put(body, SensorSample(std::move(corners)));
}

void SessionRecorder::take_turn(std::size_t body, const BodyUpdate& update, const MapView& view,
                                std::uint64_t turn) {
  if (!recording_) return;
  const CornerFrame& image = update.corners;
  MapTurn now{turn,
              body,
              to_ns(image.exposed_at - image.clock_shift),
              image.camera,
              static_cast<std::int64_t>(view.revision),
              view.may_define_workspace,
              {}};
  if (update.is_placed()) now.X_WB = update.estimate->X_WB;
  put(body, now);
}

void SessionRecorder::put(std::size_t body,
                          std::variant<std::monostate, SensorSample, MapTurn> what) {
  {
    const std::lock_guard lock(mutex_);
    if (!session_) return;
    const std::size_t bytes = image_bytes(what);
    if (waiting_.size() >= kMaxWaiting || waiting_bytes_ + bytes > kMaxWaiting_bytes) {
      ++session_->dropped;
      return;
    }
    waiting_bytes_ += bytes;
    waiting_.push_back({session_, body, std::move(what), bytes});
  }
  filled_.notify_one();
}

void SessionRecorder::run(std::stop_token stop) {
  std::vector<Item> writing;
  for (bool last = false; !last;) {
    {
      std::unique_lock lock(mutex_);
      filled_.wait(lock, stop, [this] { return !waiting_.empty(); });
      last = stop.stop_requested();
      if (last && session_) waiting_.push_back({std::exchange(session_, nullptr), 0, {}});
      writing.swap(waiting_);
    }
    for (Item& item : writing) {
      write(item);
      waiting_bytes_ -= item.image_bytes;
      item.what = {};
    }
    writing.clear();
  }
}

Expected<void> SessionRecorder::write_or_finish(Item& item) {
  Session& session = *item.session;
  if (const auto* sample = std::get_if<SensorSample>(&item.what))
    return session.failed ? Expected<void>{} : session.writers.at(item.body).write(*sample);
  if (auto* turn = std::get_if<MapTurn>(&item.what)) {
    if (!session.turns || session.failed) return {};
    turn->revision -= static_cast<std::int64_t>(session.first_revision);
    if (const auto& truth = truths_[item.body].at) {
      const auto done =
          session.writers[item.body].write_truth(truth(instant_from_ns(turn->stamp_ns)));
      if (!done) return done;
    }
    return session.turns->write(*turn);
  }
  Expected<void> done;
  for (auto& writer : session.writers)
    if (auto finished = writer.finish(); !finished) done = finished;
  if (session.turns)
    if (auto finished = session.turns->flush(); !finished) done = finished;
  log::info("recorder", "recording \"" + session.name + "\" ended, " +
                            std::to_string(session.dropped) +
                            " samples dropped because the disk was slow");
  return done;
}

void SessionRecorder::write(Item& item) {
  Session& session = *item.session;
  Expected<void> done;
  try {
    done = write_or_finish(item);
  } catch (const std::exception& failure) {
    done = fail(ErrorCode::kUnavailable, failure.what());
  }
  if (done || session.failed) return;
  session.failed = true;
  log::error("recorder", "recording \"" + session.name +
                             "\" cannot be written any more: " + done.error().text());
}

}  // namespace fiducap
