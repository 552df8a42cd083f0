#include <fiducap/control.hpp>

#include <cstdio>
#include <cstdlib>

int main() {
  fiducap::ControlOptions options;
  const char* token = std::getenv("FIDUCAP_TOKEN");
  options.token = token != nullptr ? token : "";
  fiducap::Control control(options);

  fiducap::ControlState state;
  fiducap::Outcome outcome = control.list(state);
  for (const auto& body : state.bodies) {
    if (outcome && !body.enabled) outcome = control.set_enabled(body.id, true);
  }
  if (outcome) outcome = control.start_recording();
  if (!outcome) std::printf("%s\n", outcome.problem.c_str());
}
