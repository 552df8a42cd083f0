#include "tools/terminal.hpp"

#include <csignal>

#include <nlohmann/json.hpp>

namespace fiducap {
namespace {

volatile std::sig_atomic_t g_interrupted = 0;

void on_signal(int signal) {
  g_interrupted = 1;
  std::signal(signal, SIG_DFL);
}

}  // namespace

int report(const Terminal& terminal, const Error& error) {
  terminal.err << "fiducap: " << error.text() << std::endl;
  return kExitFailed;
}

Error in_context(Error error, const std::string& context) {
  if (error.context.empty()) error.context = context;
  return error;
}

int print_json(const Terminal& terminal, const nlohmann::ordered_json& json) {
  constexpr auto kReplace = nlohmann::ordered_json::error_handler_t::replace;
  terminal.out << json.dump(2, ' ', false, kReplace) << "\n";
  return kExitOk;
}

ProgressLine::~ProgressLine() {
  if (shown_) terminal_.err << "\r\x1b[K" << std::flush;
}

void ProgressLine::show(const std::string& text) {
  if (!terminal_.err_is_live) return;
  const auto now = std::chrono::steady_clock::now();
  if (shown_ && now - last_ < std::chrono::milliseconds(200)) return;
  terminal_.err << '\r' << text << "\x1b[K" << std::flush;
  last_ = now;
  shown_ = true;
}

void catch_interrupt() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

bool interrupted() { return g_interrupted != 0; }

}  // namespace fiducap
