#include "base/log_lines.hpp"

namespace fiducap::log {

std::string printable(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte != 0x7f) {
      out += c;
    } else {
      out += "\\x";
      out += kDigits[byte >> 4];
      out += kDigits[byte & 15];
    }
  }
  return out;
}

bool LineLimiter::allow(const LineSource& source, Level level, Time now) {
  Window& window = windows_.try_emplace({source, level}, Window{now, 0}).first->second;
  // A window with lines left out waits for `ended`, which says so.
  if (now - window.since >= kWindow && window.lines <= kMost) window = {now, 0};
  return ++window.lines <= kMost;
}

std::vector<LineLimiter::LeftOut> LineLimiter::ended(Time now) {
  std::vector<LeftOut> out;
  for (auto one = windows_.begin(); one != windows_.end();) {
    const auto& [key, window] = *one;
    const bool is_over = now - window.since >= kWindow;
    if (is_over && window.lines > kMost)
      out.push_back({key.first, key.second, window.lines - kMost});
    one = is_over ? windows_.erase(one) : std::next(one);
  }
  return out;
}

void LineQueue::push(Line line) {
  if (lines_.size() < kMost) {
    lines_.push_back(std::move(line));
  } else {
    ++left_out_;
  }
}

Line LineQueue::pop() {
  Line line = std::move(lines_.front());
  lines_.pop_front();
  return line;
}

}  // namespace fiducap::log
