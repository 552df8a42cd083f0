#include "tools/terminal.hpp"

#include <algorithm>
#include <csignal>
#include <utility>

#include <nlohmann/json.hpp>

namespace fiducap {
namespace {

volatile std::sig_atomic_t g_interrupted = 0;

void on_signal(int signal) {
  g_interrupted = 1;
  std::signal(signal, SIG_DFL);
}

}  // namespace

void PrintableOutput::write(std::string_view text) {
  constexpr std::string_view kKept = "\n\t";
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of(kKept), text.size());
    to_ << printable(text.substr(0, end));
    if (end == text.size()) return;
    to_ << text[end];
    text.remove_prefix(end + 1);
  }
}

void PrintableOutput::pass(std::string_view bytes) {
  sync();
  to_ << bytes << std::flush;
}

PrintableOutput::int_type PrintableOutput::overflow(int_type c) {
  if (traits_type::eq_int_type(c, traits_type::eof())) return traits_type::not_eof(c);
  const char one = traits_type::to_char_type(c);
  return xsputn(&one, 1) == 1 ? c : traits_type::eof();
}

std::streamsize PrintableOutput::xsputn(const char* text, std::streamsize size) {
  constexpr std::size_t kLongest = 4;  // of a UTF-8 character
  begun_.append(text, static_cast<std::size_t>(size));
  // The last character may come in two calls.
  std::size_t end = begun_.size();
  const auto byte = [this](std::size_t i) { return static_cast<unsigned char>(begun_[i]); };
  for (std::size_t back = 1; back < kLongest && back <= begun_.size(); ++back) {
    const std::size_t i = begun_.size() - back;
    if ((byte(i) & 0xc0U) == 0x80U) continue;
    const std::size_t wanted = byte(i) >= 0xf0 ? 4 : byte(i) >= 0xe0 ? 3 : byte(i) >= 0xc2 ? 2 : 1;
    if (wanted > back) end = i;
    break;
  }
  write(std::string_view(begun_).substr(0, end));
  begun_.erase(0, end);
  return to_ ? size : 0;
}

int PrintableOutput::sync() {
  write(std::exchange(begun_, {}));
  to_.flush();
  return to_ ? 0 : -1;
}

void draw(std::ostream& to, std::string_view text) {
  if (auto* const output = dynamic_cast<PrintableOutput*>(to.rdbuf()); output != nullptr)
    output->pass(text);
  else
    to << text << std::flush;
}

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
  if (shown_) draw(terminal_.err, "\r\x1b[K");
}

void ProgressLine::show(const std::string& text) {
  if (!terminal_.err_is_live) return;
  const auto now = std::chrono::steady_clock::now();
  if (shown_ && now - last_ < std::chrono::milliseconds(200)) return;
  draw(terminal_.err, '\r' + printable(text) + "\x1b[K");
  last_ = now;
  shown_ = true;
}

void catch_interrupt() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

bool interrupted() { return g_interrupted != 0; }

}  // namespace fiducap
