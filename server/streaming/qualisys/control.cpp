#include "streaming/qualisys/control.hpp"

#include <algorithm>
#include <array>

#include "streaming/qualisys/settings.hpp"

namespace fiducap::qualisys {

namespace {

Reply yes(std::string text) { return {true, std::move(text), false}; }
Reply no(std::string text) { return {false, std::move(text), false}; }

struct Refusal {
  std::string_view word;
  std::string_view text;
};
/// What QTM does and we have nothing for.
constexpr std::array<Refusal, 7> kRefusals{{
    {"Load", "Failed to load measurement"},
    {"LoadProject", "Failed to load project"},
    {"Trig", "QTM not waiting for trig"},
    {"Event", "QTM is not capturing"},
    {"SetQTMEvent", "QTM is not capturing"},
    {"Reprocess", "No file open"},
    {"Calibrate", "Can not start calibration"},
}};

/// Why the newest recording failed; nullopt: it did not.
std::optional<std::string> failure_of(const std::vector<RecordingStatus>& recordings) {
  if (recordings.empty() || recordings.back().state != RecordingStatus::State::kFailed)
    return std::nullopt;
  return "The measurement failed: " + recordings.back().reason;
}

bool is_saved(const std::vector<RecordingStatus>& recordings, const std::string& name) {
  return std::any_of(recordings.begin(), recordings.end(), [&](const RecordingStatus& one) {
    return one.name == name && one.state == RecordingStatus::State::kFinished;
  });
}

bool is_for_masters(const Command& command) {
  for (const std::string_view word : {"New", "Close", "Start", "Stop", "Save"}) {
    if (command.is(word)) return true;
  }
  for (const Refusal& refusal : kRefusals) {
    if (command.is(refusal.word)) return true;
  }
  return false;
}

}  // namespace

Reply Control::take(ClientId client, std::string_view peer, std::string_view password) {
  if (is_master(client)) return yes("You are already master");
  if (desk_ == nullptr) return no("Client control disabled in QTM");
  if (!desk_->admits(password)) return {false, "Wrong or missing password", true};
  if (master_) return no(master_peer_ + " is already master");
  master_ = client;
  master_peer_ = peer;
  return yes("You are now master");
}

Reply Control::release(ClientId client) {
  if (!is_master(client)) return yes("You are already a regular client");
  left(client);
  return yes("You are now a regular client");
}

void Control::left(ClientId client) {
  if (is_master(client)) master_.reset();
}

std::optional<Reply> Control::execute(ClientId client, const Command& command) {
  if (command.is("GetCaptureC3D") || command.is("GetCaptureQTM") || command.is("GetCapture")) {
    return no("No capture to get");
  }
  if (!is_for_masters(command)) return std::nullopt;
  if (!is_master(client)) return no("You must be master to issue this command");
  if (command.is("New")) return yes("Already connected");
  if (command.is("Close")) return close();
  if (command.is("Start")) return start(command.rest);
  if (command.is("Stop")) return stop();
  if (command.is("Save")) return save();
  for (const Refusal& refusal : kRefusals) {
    if (command.is(refusal.word)) return no(std::string(refusal.text));
  }
  return std::nullopt;
}

Reply Control::start(std::string_view argument) {
  if (same_word(argument, "RTFromFile")) return no("No file open");
  if (recording()) return no("Measurement is already running");
  if (const auto started = desk_->start_recording({}); !started) return no(started.error().text());
  return yes("Starting measurement");
}

Reply Control::stop() {
  if (!recording()) {
    const auto failed = failure_of(desk_->recordings());
    return no(failed ? *failed : "No measurement is running");
  }
  last_capture_ = *desk_->recording();
  if (const auto stopped = desk_->stop_recording(); !stopped) return no(stopped.error().text());
  return yes("Stopping measurement");
}

Reply Control::save() const {
  if (recording()) return no("Failed to save measurement");
  if (last_capture_.empty()) return no("No measurement to save");
  if (!is_saved(desk_->recordings(), last_capture_)) return no("Failed to save measurement");
  return yes("Measurement saved as '" + last_capture_ + "'");
}

Reply Control::close() {
  if (recording()) return no("Measurement is already running");
  if (last_capture_.empty()) return yes("No connection to close");
  last_capture_.clear();
  return yes("Closing file");
}

Reply Control::apply_settings(ClientId client, std::string_view xml,
                              std::span<const BodyTable::Entry> bodies) {
  const auto failed = [] { return no("Setting parameters failed"); };
  if (!is_master(client)) return no("You must be master to issue this command");
  const auto switches = parse_body_switches(xml);
  if (!switches || switches->empty()) return failed();
  for (const BodySwitch& one : *switches) {
    const auto body = std::find_if(bodies.begin(), bodies.end(),
                                   [&](const auto& entry) { return entry.name == one.name; });
    if (body == bodies.end()) return failed();
    if (body->enabled != one.enabled && !desk_->set_enabled(body->id, one.enabled)) return failed();
  }
  return yes("Setting parameters succeeded");
}

Event Control::state() const { return recording() ? Event::kCaptureStarted : Event::kConnected; }

void Control::observe(std::vector<Event>& out) {
  if (desk_ == nullptr) return;
  const auto now = desk_->recording();
  if (now && !running_) out.push_back(Event::kCaptureStarted);
  if (!now && running_) {
    out.push_back(Event::kCaptureStopped);
    ending_ = running_;
  }
  running_ = now;
  if (!ending_) return;
  // What waits for the disk may still fail.
  const auto recordings = desk_->recordings();
  const bool is_ending = std::any_of(
      recordings.begin(), recordings.end(),
      [&](const RecordingStatus& one) { return one.name == *ending_ && !one.is_over(); });
  if (is_ending) return;
  if (is_saved(recordings, *ending_)) out.push_back(Event::kCaptureSaved);
  ending_.reset();
  // Frames go on: a client that waits for live data may take them.
  if (!now) out.push_back(Event::kConnected);
}

}  // namespace fiducap::qualisys
