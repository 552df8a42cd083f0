#include "daemon/recording/session_recorder.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <utility>

#include "detection/observe.hpp"

namespace fiducap {
namespace {

/// Memory beside the item itself.
struct Attached {
  template <typename Other>
  std::size_t operator()(const Other&) const {
    return 0;
  }
  std::size_t operator()(const SensorSample& sample) const { return std::visit(*this, sample); }
  std::size_t operator()(const CameraFrame& frame) const {
    return frame.image ? sizeof(GrayImage) + frame.image->pixels.capacity() : 0;
  }
  std::size_t operator()(const CornerFrame& frame) const {
    return frame.tags.capacity() * sizeof(TagSighting) +
           frame.points.capacity() * sizeof(PointSighting);
  }
};

bool is_image(const RecordedThing& what) {
  const auto* sample = std::get_if<SensorSample>(&what);
  return sample != nullptr && !std::holds_alternative<ImuSample>(*sample);
}

constexpr std::size_t kRemembered = 8;
constexpr std::chrono::milliseconds kFlushCheck{200};  // while no items come
constexpr Duration kStuckAfter = std::chrono::seconds(3);
constexpr Duration kStuckTimeout = std::chrono::seconds(2);  // without progress, at the end
constexpr Duration kLongestEnd = std::chrono::seconds(20);
constexpr const char* kSlow = "slow";

bool is_folder_name(const std::string& name) {
  const auto good = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.' || c == ' ';
  };
  return !name.empty() && name.size() <= 127 && name.front() != '.' &&
         std::ranges::all_of(name, good);
}

}  // namespace

bool RecordingQueue::put(RecordedItem item) {
  item.bytes = sizeof(RecordedItem) + std::visit(Attached{}, item.what);
  const std::size_t limit = is_image(item.what) ? kImages_bytes : kMost_bytes;
  const bool is_border = std::holds_alternative<SessionStart>(item.what) ||
                         std::holds_alternative<SessionEnd>(item.what);
  if (!is_border && bytes_ + item.bytes > limit) return false;
  bytes_ += item.bytes;
  waiting_.push_back(std::move(item));
  return true;
}

void RecordingQueue::take_all(std::deque<RecordedItem>& out) {
  out.clear();
  out.swap(waiting_);
}

SessionRecorder::SessionRecorder(RecorderConfig config, const Clock& clock, EventBoard& events)
    : config_(std::move(config)),
      clock_(clock),
      events_(events),
      writer_(config_.folder.empty() ? "recordings" : config_.folder, bodies_, clock, events) {}

void SessionRecorder::add_body(const std::string& name, RecordingInfo info, SimulatedTruth truth) {
  info.name = name;
  info.has_images.assign(info.cameras.size(), config_.images);
  info.has_corners.assign(info.cameras.size(), !config_.images);
  bodies_.push_back({std::move(info), std::move(truth)});
}

// Requests of the operator.

Expected<void> SessionRecorder::start(const std::string& name) {
  if (!is_folder_name(name))
    return fail(ErrorCode::kInvalid,
                "a recording's name must have 1 to 127 of a-z A-Z 0-9 _ - . and space", name);
  SessionStart begin{surroundings_.config_yaml, std::nullopt};
  if (surroundings_.published) begin.map = surroundings_.published();
  {
    const std::lock_guard lock(mutex_);
    if (auto admitted = admit(name); !admitted) return admitted;
    if (sessions_.size() == kRemembered) sessions_.pop_front();
    session_ = std::make_shared<RecordedSession>(name);
    sessions_.push_back(session_);
    static_cast<void>(queue_.put({session_, 0, std::move(begin)}));
    recording_ = true;
  }
  filled_.notify_one();
  return {};
}

/// @pre the lock is held
Expected<void> SessionRecorder::admit(const std::string& name) const {
  if (is_under_way())
    return fail(ErrorCode::kUnavailable,
                "the recording \"" + session_->name() + "\" is under way; stop it first");
  const auto same = [&](const auto& other) { return !other->is_over() && other->name() == name; };
  if (std::ranges::any_of(sessions_, same))
    return fail(ErrorCode::kInvalid, "a recording of this name is still being written", name);
  if (sessions_.size() == kRemembered && !sessions_.front()->is_over())
    return fail(ErrorCode::kUnavailable, "too many recordings wait for the disk already");
  return {};
}

Expected<void> SessionRecorder::start_and_open(const std::string& name) {
  std::error_code unknown;
  std::string free = name;
  for (int n = 2; std::filesystem::exists(writer_.folder() / free, unknown); ++n)
    free = name + "-" + std::to_string(n);
  if (auto started = start(free); !started) return started;
  std::deque<RecordedItem> begin;
  {
    const std::lock_guard lock(mutex_);
    queue_.take_all(begin);
  }
  write(begin);
  const RecordingStatus status = recordings().back();
  if (status.is_over()) return fail(ErrorCode::kUnavailable, status.reason);
  return {};
}

Expected<void> SessionRecorder::stop() {
  {
    const std::lock_guard lock(mutex_);
    if (!is_under_way()) {
      std::string why = "no recording is under way";
      if (!sessions_.empty() && sessions_.back()->state() == RecordingStatus::State::kFailed) {
        const RecordingStatus last = sessions_.back()->status();
        why += ": \"" + last.name + "\" has failed: " + last.reason + " (" + last.counts() + ")";
      }
      return fail(ErrorCode::kUnavailable, why);
    }
    end_current();
  }
  filled_.notify_one();
  return {};
}

/// @pre the lock is held
bool SessionRecorder::is_under_way() const { return session_ && !session_->is_over(); }

/// @pre the lock is held, there is a session
void SessionRecorder::end_current() {
  recording_ = false;
  session_->stopping();
  static_cast<void>(queue_.put({std::exchange(session_, nullptr), 0, SessionEnd{}}));
}

std::optional<std::string> SessionRecorder::current() const {
  const std::lock_guard lock(mutex_);
  return is_under_way() ? std::optional(session_->name()) : std::nullopt;
}

std::vector<RecordingStatus> SessionRecorder::recordings() const {
  const std::lock_guard lock(mutex_);
  std::vector<RecordingStatus> all;
  for (const auto& session : sessions_) all.push_back(session->status());
  return all;
}

// Samples from the workers.

void SessionRecorder::take(std::size_t body, const SensorSample& sample) {
  if (!recording_) return;
  if (std::holds_alternative<CameraFrame>(sample) && !config_.images) return;
  put(body, sample);
}

void SessionRecorder::take_found(std::size_t body, const CornerFrame& found) {
  if (!recording_ || config_.images) return;
  CornerFrame corners = found;
  const auto camera = static_cast<std::size_t>(found.camera);
  const auto& cameras = bodies_[body].info.cameras;
  // A recording holds raw corners, not the intersections of lines fitted to distorted sides.
  if (found.fitted_straight_sides && camera < cameras.size()) {
    for (TagSighting& tag : corners.tags)
      tag.corners_px = unbend_corners(cameras[camera].model, tag.corners_px);
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

void SessionRecorder::take_refinement(const RefinementTurn& turn) {
  if (recording_) put(0, turn);
}

void SessionRecorder::put(std::size_t body, RecordedThing what) {
  {
    const std::lock_guard lock(mutex_);
    if (!is_under_way()) return;
    if (working_ && clock_.now() - instant_from_ns(progress_ns_) > kStuckAfter)
      report_slowness(Slowness::kStuck);
    if (!queue_.put({session_, body, std::move(what)})) {
      session_->drop();
      return report_slowness(Slowness::kDropping);
    }
  }
  filled_.notify_one();
}

/// @pre the lock is held
void SessionRecorder::report_slowness(Slowness how) {
  if (how <= slowness_) return;
  slowness_ = how;
  const bool drops = how == Slowness::kDropping;
  events_.begin({.severity = drops ? Severity::kError : Severity::kWarning,
                 .subject = kRecorder,
                 .kind = kSlow,
                 .text = drops ? "the disk does not keep up with the recording \"" +
                                     session_->name() + "\": samples are dropped"
                               : "the disk has taken nothing of the recording \"" +
                                     session_->name() + "\" for 3 s; samples wait in memory",
                 .remedy = "Record to a faster disk (`recorder.folder`), or corners instead of "
                           "images (`recorder.images: false`)"});
}

// The writer.

void SessionRecorder::run(std::stop_token stop) {
  std::deque<RecordedItem> batch;
  for (bool last = false; !last;) {
    last = wait_for_work(batch, stop);
    write(batch);
    writer_.flush_when_due();
    report_caught_up();
  }
  working_ = false;
  ended_ = true;
}

/// @return true: the last batch
bool SessionRecorder::wait_for_work(std::deque<RecordedItem>& batch, std::stop_token stop) {
  working_ = false;
  std::unique_lock lock(mutex_);
  const auto filled = [this] { return !queue_.empty(); };
  if (writer_.is_open()) {
    filled_.wait_for(lock, stop, kFlushCheck, filled);
  } else {
    filled_.wait(lock, stop, filled);
  }
  progress_ns_ = to_ns(clock_.now());
  working_ = true;
  const bool last = stop.stop_requested();
  if (last && session_) end_current();
  queue_.take_all(batch);
  return last;
}

void SessionRecorder::write(std::deque<RecordedItem>& batch) {
  for (; !batch.empty(); batch.pop_front()) {
    writer_.write(batch.front());
    queue_.written(batch.front());
    progress_ns_ = to_ns(clock_.now());
    writer_.flush_when_due();
  }
}

void SessionRecorder::report_caught_up() {
  const std::lock_guard lock(mutex_);
  if (slowness_ == Slowness::kNone || !queue_.empty()) return;
  slowness_ = Slowness::kNone;
  events_.end(kRecorder, kSlow, "the disk has written everything that waited");
}

bool SessionRecorder::ends() const {
  constexpr Duration kBriefly = std::chrono::milliseconds(5);
  const Instant begin = clock_.now();
  while (!ended_) {
    const Instant now = clock_.now();
    const Instant progress = std::max(begin, instant_from_ns(progress_ns_));
    if (now - progress > kStuckTimeout || now - begin > kLongestEnd) {
      events_.report({.severity = Severity::kError,
                      .subject = kRecorder,
                      .kind = "lost",
                      .text = "the disk is stuck: " + std::to_string(queue_.bytes() >> 10) +
                              " KiB of the recording are lost",
                      .remedy = "Check the disk of `recorder.folder`"});
      return false;
    }
    static_cast<void>(clock_.wait_until(now + kBriefly, {}));
  }
  return true;
}

}  // namespace fiducap
