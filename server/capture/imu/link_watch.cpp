#include "capture/imu/link_watch.hpp"

#include <chrono>

namespace fiducap {

namespace {

constexpr std::size_t kEnoughBytes = 4096;
constexpr Duration kLongSilence = std::chrono::seconds(5);
constexpr double kMostlyText = 0.9;  // of random bytes 0.38 are
constexpr std::uint64_t kWindow = 1000;
constexpr double kDisturbed = 0.01;

}  // namespace

bool is_printable(std::byte byte) {
  const auto c = static_cast<unsigned char>(byte);
  return (c >= 0x20 && c < 0x7f) || c == '\n' || c == '\r' || c == '\t';
}

void LinkWatch::add(std::size_t bytes, std::size_t printable, std::uint64_t units,
                    std::uint64_t broken, Instant now) {
  if (!heard_at_) heard_at_ = now;
  if (bytes == 0) {
    if (told_silent_ || now - *heard_at_ < kLongSilence) return;
    told_silent_ = true;
    return say(is_serial_
                   ? "nothing has come for 5 s: does the device send, is its TX wired to this "
                     "end's RX, and is it the right port?"
                   : "nothing has come for 5 s: does the device send to this machine's address "
                     "and port, and does no firewall stop it?");
  }
  heard_at_ = now;
  if (std::exchange(told_silent_, false)) say("it sends again");
  bytes_ += bytes;
  printable_ += printable;
  broken_ += broken;
  units_ += units;
  broken_in_window_ += broken;
  if (units > 0) {
    bytes_ = printable_ = 0;
    broken_ = 0;
    told_foreign_ = false;
  }
  if (bytes_ >= kEnoughBytes && !std::exchange(told_foreign_, true)) say_what_it_looks_like();
  if (units_ + broken_in_window_ < kWindow) return;
  const double share =
      static_cast<double>(broken_in_window_) / static_cast<double>(units_ + broken_in_window_);
  const bool disturbed = units_ > 0 && share > kDisturbed;
  if (disturbed && !told_broken_)
    say(std::to_string(broken_in_window_) + " of " + std::to_string(units_ + broken_in_window_) +
        " have a wrong checksum and are left out: is the line disturbed, or too slow for what is "
        "sent?");
  told_broken_ = disturbed;
  units_ = broken_in_window_ = 0;
}

void LinkWatch::say_what_it_looks_like() {
  const std::string none = "no " + unit_ + " among " + std::to_string(bytes_) + " bytes";
  const bool is_text = static_cast<double>(printable_) > kMostlyText * static_cast<double>(bytes_);
  if (broken_ > 0 && is_text)
    return say(
        none + ", but " + std::to_string(broken_) +
        " that would be one with another checksum: does the device compute it as documented?");
  if (is_text) return say(none + ": it is a text, but another one. Is it the right device?");
  if (is_serial_)
    return say(none + ": is the baud rate right (" + std::to_string(baud_) + " here)?");
  say(none + ": something else is sent to this port");
}

/// Of two at once the later one is the better.
void LinkWatch::say(std::string text) { news_ = std::move(text); }

}  // namespace fiducap
