#include "tools/live/watch_command.hpp"

#include <algorithm>
#include <charconv>
#include <chrono>

#include "fiducap/client.hpp"
#include "tools/interrupt.hpp"
#include "tools/live/watch_view.hpp"

namespace fiducap {
namespace {

using SteadyTime = std::chrono::steady_clock::time_point;
constexpr std::chrono::seconds kPatience{2};  // this long without an answer, then say so
constexpr std::chrono::milliseconds kLivePeriod{100};
constexpr std::chrono::seconds kLinePeriod{1};

ClientOptions options(const ServerAddress& address) {
  ClientOptions options;
  options.server = address.host;
  options.port = address.port;
  options.name = "fiducap watch";
  return options;
}

class Watch final {
 public:
  Watch(const ServerAddress& address, bool json, const Terminal& terminal)
      : name_(address.host + ":" + std::to_string(address.port)),
        json_(json),
        terminal_(terminal),
        client_(options(address)) {}

  int run(std::optional<SteadyTime> end) {
    while (!interrupted() && terminal_.out) {
      const SteadyTime now = std::chrono::steady_clock::now();
      if (end && now >= *end) break;
      if (client_.wait_for_frame(newest_, std::chrono::milliseconds(100)) &&
          client_.latest(frame_)) {
        newest_ = frame_.number;
        last_frame_ = now;
        seen_ = true;
        complained_ = false;
      } else if (now - last_frame_ > kPatience) {
        complain();
      }
      if (seen_) show(now);
    }
    if (!seen_) complain();
    return seen_ ? kExitOk : kExitFailed;
  }

 private:
  void complain() {
    if (complained_) return;
    complained_ = true;
    const std::string problem = client_.statistics().problem;
    terminal_.err
        << "fiducap: no Fiducap server answers at " << name_
        << (problem.empty() ? "" : " (" + problem + ")")
        << ". Start one (fiducapd --config config/demo.yaml), look at its streaming.native "
           "section, or name another with --server HOST:PORT."
        << std::endl;
    lines_shown_ = 0;  // what is on the screen has moved
  }

  void show(SteadyTime now) {
    if (json_) {
      if (frame_.number == shown_frame_) return;
      terminal_.out << watch_json(frame_, client_.statistics()) << std::flush;
    } else if (terminal_.out_is_live) {
      if (now - last_shown_ < kLivePeriod) return;
      redraw(watch_table(name_, frame_, client_.statistics()));
    } else {
      if (now - last_shown_ < kLinePeriod || frame_.number == shown_frame_) return;
      terminal_.out << watch_lines(frame_, client_.statistics()) << std::flush;
    }
    shown_frame_ = frame_.number;
    last_shown_ = now;
  }

  /// Over the old table: up, then every line anew, the rest of the screen wiped.
  void redraw(const std::string& table) {
    std::string text;
    if (lines_shown_ > 0) text += "\x1b[" + std::to_string(lines_shown_) + "A\r";
    for (const char c : table) text += c == '\n' ? std::string("\x1b[K\n") : std::string(1, c);
    terminal_.out << text << "\x1b[J" << std::flush;
    lines_shown_ = std::count(table.begin(), table.end(), '\n');
  }

  std::string name_;
  bool json_;
  const Terminal& terminal_;
  Client client_;
  Frame frame_;
  std::uint64_t newest_{0};
  std::uint64_t shown_frame_{0};
  SteadyTime last_frame_{std::chrono::steady_clock::now()};
  SteadyTime last_shown_{};
  std::ptrdiff_t lines_shown_{0};
  bool seen_{false};
  bool complained_{false};
};

}  // namespace

std::optional<ServerAddress> parse_server_address(std::string_view text,
                                                  std::uint16_t default_port) {
  ServerAddress address{std::string(text), default_port};
  const bool bracketed = text.starts_with('[');
  const std::size_t close = bracketed ? text.find(']') : 0;
  if (close == std::string_view::npos) return std::nullopt;
  if (bracketed) address.host = text.substr(1, close - 1);
  const std::size_t colon = text.find(':', close);
  // More than one colon without brackets is a bare IPv6 address.
  const bool bare_ipv6 = !bracketed && colon != std::string_view::npos &&
                         text.find(':', colon + 1) != std::string_view::npos;
  if (colon != std::string_view::npos && !bare_ipv6) {
    if (!bracketed) address.host = text.substr(0, colon);
    const std::string_view port = text.substr(colon + 1);
    const auto parsed = std::from_chars(port.data(), port.data() + port.size(), address.port);
    if (parsed.ec != std::errc{} || parsed.ptr != port.data() + port.size() || address.port == 0)
      return std::nullopt;
  } else if (bracketed && close + 1 != text.size()) {
    return std::nullopt;
  }
  if (address.host.empty()) return std::nullopt;
  return address;
}

int run_watch(const WatchArguments& arguments, const Terminal& terminal) {
  const auto address = parse_server_address(arguments.server, ClientOptions{}.port);
  if (!address) {
    report(terminal,
           {ErrorCode::kInvalid, "'" + arguments.server + "' is no HOST or HOST:PORT", "--server"});
    return kExitUsage;
  }
  catch_interrupt();
  std::optional<SteadyTime> end;
  if (arguments.duration_s > 0)
    end = std::chrono::steady_clock::now() +
          std::chrono::duration_cast<std::chrono::steady_clock::duration>(
              std::chrono::duration<double>(arguments.duration_s));
  return Watch(*address, arguments.json, terminal).run(end);
}

}  // namespace fiducap
