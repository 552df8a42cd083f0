#include "tools/terminal.hpp"

namespace fiducap {

int report(const Terminal& terminal, const Error& error) {
  terminal.err << "fiducap: " << error.text() << std::endl;
  return kExitFailed;
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

}  // namespace fiducap
