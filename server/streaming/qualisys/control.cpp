#include "streaming/qualisys/control.hpp"

#include <algorithm>
#include <array>

#include "streaming/qualisys/xml.hpp"

namespace fiducap::qualisys {

namespace {

struct Refusal {
  std::string_view word;
  std::string_view text;
};
constexpr std::array<std::string_view, 5> kMasterWords{"New", "Close", "Start", "Stop", "Save"};
/// Further commands for masters, which are not supported, with QTM's texts.
constexpr std::array<Refusal, 7> kRefusals{{
    {"Load", "Failed to load measurement"},
    {"LoadProject", "Failed to load project"},
    {"Trig", "QTM not waiting for trig"},
    {"Event", "QTM is not capturing"},
    {"SetQTMEvent", "QTM is not capturing"},
    {"Reprocess", "No file open"},
    {"Calibrate", "Can not start calibration"},
}};

/// Why the newest recording failed; nullopt: it has not failed.
std::optional<std::string> failure_of(const std::vector<RecordingStatus>& recordings) {
  if (recordings.empty() || recordings.back().state != RecordingStatus::State::kFailed)
    return std::nullopt;
  return "The measurement failed: " + recordings.back().reason;
}

bool is_saved(const std::vector<RecordingStatus>& recordings, const std::string& name) {
  return std::ranges::any_of(recordings, [&](const RecordingStatus& one) {
    return one.name == name && one.state == RecordingStatus::State::kFinished;
  });
}

}  // namespace

Reply Control::take(ClientId client, std::string_view peer, std::string_view password) {
  if (is_master(client)) return Reply::done("You are already master");
  if (operator_api_ == nullptr) return Reply::refused("Client control disabled in QTM");
  if (!operator_api_->admits(password)) {
    operator_api_->note_refusal({kName, {}, std::string(peer)}, "prove a token", "wrong token");
    return {false, "Wrong or missing password", true};
  }
  if (master_ && is_master(*master_)) return Reply::refused(master_peer_ + " is already master");
  master_ = client;
  master_peer_ = peer;
  proven_at_ = operator_api_->tokens_changed();
  return Reply::done("You are now master");
}

Reply Control::release(ClientId client) {
  if (!is_master(client)) return Reply::done("You are already a regular client");
  left(client);
  return Reply::done("You are now a regular client");
}

void Control::left(ClientId client) {
  if (master_ == client) master_.reset();
}

std::optional<Reply> Control::execute(ClientId client, const Command& command) {
  if (command.is("GetCaptureC3D") || command.is("GetCaptureQTM") || command.is("GetCapture"))
    return Reply::refused("No capture to get");
  const auto is_it = [&](std::string_view word) { return command.is(word); };
  const auto refusal = std::ranges::find_if(kRefusals, is_it, &Refusal::word);
  if (refusal == kRefusals.end() && std::ranges::none_of(kMasterWords, is_it)) return std::nullopt;
  if (!is_master(client)) return Reply::refused("You must be master to issue this command");
  if (command.is("New")) return Reply::done("Already connected");
  if (command.is("Close")) return close();
  if (command.is("Start")) return start(command.rest);
  if (command.is("Stop")) return stop();
  if (command.is("Save")) return save();
  return Reply::refused(std::string(refusal->text));
}

Reply Control::start(std::string_view argument) {
  if (same_word(argument, "RTFromFile")) return Reply::refused("No file open");
  if (recording()) return Reply::refused("Measurement is already running");
  if (const auto started = operator_api_->start_recording(master(), {}); !started)
    return Reply::refused(started.error().text());
  return Reply::done("Starting measurement");
}

Reply Control::stop() {
  if (!recording()) {
    const auto failed = failure_of(operator_api_->recordings());
    return Reply::refused(failed ? *failed : "No measurement is running");
  }
  last_capture_ = *operator_api_->recording();
  if (const auto stopped = operator_api_->stop_recording(master()); !stopped)
    return Reply::refused(stopped.error().text());
  return Reply::done("Stopping measurement");
}

Reply Control::save() const {
  if (recording()) return Reply::refused("Failed to save measurement");
  if (last_capture_.empty()) return Reply::refused("No measurement to save");
  if (!is_saved(operator_api_->recordings(), last_capture_))
    return Reply::refused("Failed to save measurement");
  return Reply::done("Measurement saved as '" + last_capture_ + "'");
}

Reply Control::close() {
  if (recording()) return Reply::refused("Measurement is already running");
  if (last_capture_.empty()) return Reply::done("No connection to close");
  last_capture_.clear();
  return Reply::done("Closing file");
}

Reply Control::apply_settings(ClientId client, std::string_view xml,
                              std::span<const BodyTable::Entry> bodies) {
  const auto failed = [] { return Reply::refused("Setting parameters failed"); };
  if (!is_master(client)) return Reply::refused("You must be master to issue this command");
  const auto switches = parse_body_switches(xml);
  if (!switches || switches->empty()) return failed();
  for (const BodySwitch& one : *switches) {
    const auto body =
        std::ranges::find_if(bodies, [&](const auto& entry) { return entry.name == one.name; });
    if (body == bodies.end()) return failed();
    if (body->enabled != one.enabled &&
        !operator_api_->set_enabled(master(), body->id, one.enabled))
      return failed();
  }
  return Reply::done("Setting parameters succeeded");
}

Event Control::state() const { return recording() ? Event::kCaptureStarted : Event::kConnected; }

void Control::observe(std::vector<Event>& out) {
  if (operator_api_ == nullptr) return;
  const auto now = operator_api_->recording();
  if (now && !running_) out.push_back(Event::kCaptureStarted);
  if (!now && running_) {
    out.push_back(Event::kCaptureStopped);
    ending_ = running_;
  }
  running_ = now;
  if (!ending_) return;
  // Saving may still fail.
  const auto recordings = operator_api_->recordings();
  const bool is_ending = std::ranges::any_of(recordings, [&](const RecordingStatus& one) {
    return one.name == *ending_ && !one.is_over();
  });
  if (is_ending) return;
  if (is_saved(recordings, *ending_)) out.push_back(Event::kCaptureSaved);
  ending_.reset();
  // Live frames continue.
  if (!now) out.push_back(Event::kConnected);
}

}  // namespace fiducap::qualisys
