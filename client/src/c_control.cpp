#include <exception>
#include <vector>

#include "fiducap.h"
#include "fiducap/control.hpp"
#include "src/c_struct.hpp"

struct fiducap_control {
  explicit fiducap_control(fiducap::ControlOptions options) : control(std::move(options)) {}
  fiducap::Control control;
};

namespace fiducap::sdk {

namespace {

/// Runs a command and reports the cause of a failure. No exception leaves the library.
template <typename Command>
int run(fiducap_control* control, char* problem, std::size_t problem_size, Command&& command) {
  if (control == nullptr) return 0;
  try {
    const Outcome outcome = command(control->control);
    give_text(outcome.problem, problem, problem_size);
    return outcome ? 1 : 0;
  } catch (const std::exception& why) {
    give_text(why.what(), problem, problem_size);
    return 0;
  }
}

fiducap_controlled_body to_c(const ControlledBody& body) {
  fiducap_controlled_body out{};
  out.id = body.id;
  out.enabled = body.enabled ? 1 : 0;
  std::copy(body.pivot_position_m.begin(), body.pivot_position_m.end(), out.pivot_position_m);
  std::copy(body.pivot_orientation_wxyz.begin(), body.pivot_orientation_wxyz.end(),
            out.pivot_orientation_wxyz);
  give_text(body.name, out.name, sizeof(out.name));
  return out;
}

fiducap_recording to_c(const Recording& recording) {
  fiducap_recording out{};
  out.state = static_cast<std::int32_t>(recording.state);
  out.samples = recording.samples;
  out.bytes = recording.bytes;
  out.dropped = recording.dropped;
  give_text(recording.name, out.name, sizeof(out.name));
  give_text(recording.reason, out.reason, sizeof(out.reason));
  return out;
}

/// Copies as many as fit into the caller's array, whose structs may be of another version.
template <typename Ours, typename Theirs>
void give_all(const std::vector<Ours>& all, Theirs* to, std::uint32_t* count) {
  const std::size_t capacity = count != nullptr && to != nullptr ? *count : 0;
  for (std::size_t i = 0; i < std::min(capacity, all.size()); ++i) {
    auto* at = reinterpret_cast<unsigned char*>(to) + i * to->struct_size;
    if (!give(to_c(all[i]), reinterpret_cast<Theirs*>(at))) break;
  }
  if (count != nullptr) *count = static_cast<std::uint32_t>(all.size());
}

}  // namespace

}  // namespace fiducap::sdk

namespace sdk = fiducap::sdk;

fiducap_control* fiducap_control_open(const char* server, uint16_t port, const char* token,
                                      uint32_t timeout_ms) {
  try {
    fiducap::ControlOptions options;
    options.server = sdk::text_or(server, "127.0.0.1");
    if (port != 0) options.port = port;
    options.token = sdk::text_or(token, "");
    if (timeout_ms != 0) options.timeout = std::chrono::milliseconds(timeout_ms);
    return new fiducap_control(std::move(options));
  } catch (const std::exception&) {
    return nullptr;
  }
}

void fiducap_control_close(fiducap_control* control) { delete control; }

int fiducap_control_list(fiducap_control* control, fiducap_controlled_body* bodies, uint32_t* count,
                         int* mapping, char* recording, char* problem, size_t problem_size) {
  return sdk::run(control, problem, problem_size, [&](fiducap::Control& open) {
    fiducap::ControlState state;
    fiducap::Outcome outcome = open.list(state);
    if (!outcome) return outcome;
    sdk::give_all(state.bodies, bodies, count);
    if (mapping != nullptr) *mapping = state.mapping ? 1 : 0;
    sdk::give_text(state.recording, recording, FIDUCAP_NAME_SIZE);
    return outcome;
  });
}

int fiducap_control_set_enabled(fiducap_control* control, int32_t body_id, int enabled,
                                char* problem, size_t problem_size) {
  return sdk::run(control, problem, problem_size,
                  [&](fiducap::Control& open) { return open.set_enabled(body_id, enabled != 0); });
}

int fiducap_control_rename(fiducap_control* control, int32_t body_id, const char* name,
                           char* problem, size_t problem_size) {
  return sdk::run(control, problem, problem_size, [&](fiducap::Control& open) {
    return open.rename(body_id, sdk::text_or(name, ""));
  });
}

int fiducap_control_set_pivot(fiducap_control* control, int32_t body_id, const double position_m[3],
                              const double orientation_wxyz[4], char* problem,
                              size_t problem_size) {
  return sdk::run(control, problem, problem_size, [&](fiducap::Control& open) {
    if (position_m == nullptr || orientation_wxyz == nullptr)
      return fiducap::Outcome{false, "no pivot was given"};
    const auto& p = position_m;
    const auto& q = orientation_wxyz;
    return open.set_pivot(body_id, {p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]});
  });
}

int fiducap_control_set_mapping(fiducap_control* control, int mapping, char* problem,
                                size_t problem_size) {
  return sdk::run(control, problem, problem_size,
                  [&](fiducap::Control& open) { return open.set_mapping(mapping != 0); });
}

int fiducap_control_commit_map(fiducap_control* control, char* problem, size_t problem_size) {
  return sdk::run(control, problem, problem_size,
                  [](fiducap::Control& open) { return open.commit_map(); });
}

int fiducap_control_recordings(fiducap_control* control, fiducap_recording* recordings,
                               uint32_t* count, char* problem, size_t problem_size) {
  return sdk::run(control, problem, problem_size, [&](fiducap::Control& open) {
    fiducap::ControlState state;
    fiducap::Outcome outcome = open.list(state);
    if (outcome) sdk::give_all(state.recordings, recordings, count);
    return outcome;
  });
}

int fiducap_control_start_recording(fiducap_control* control, const char* name, char* problem,
                                    size_t problem_size) {
  return sdk::run(control, problem, problem_size, [&](fiducap::Control& open) {
    return open.start_recording(sdk::text_or(name, ""));
  });
}

int fiducap_control_stop_recording(fiducap_control* control, char* problem, size_t problem_size) {
  return sdk::run(control, problem, problem_size,
                  [](fiducap::Control& open) { return open.stop_recording(); });
}
