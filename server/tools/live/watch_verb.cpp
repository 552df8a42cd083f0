#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/numeric.hpp"
#include "base/text.hpp"
#include "tools/live/live_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

struct WatchArguments {
  std::string server{"127.0.0.1"};
  double duration_s{0};  ///< 0: until Ctrl-C.
  bool json{false};
};

/// Position, yaw pitch roll, speeds, sigmas, age, tags.
constexpr const char* kColumns =
    " {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7} {:>4}\n";

const char* name_of(Tracking tracking) {
  constexpr std::array kNames{"searching", "tracking", "coasting", "lost"};
  const auto i = static_cast<std::size_t>(tracking);
  return i < kNames.size() ? kNames[i] : "lost";
}

double length(const std::array<double, 3>& v) { return std::hypot(v[0], v[1], v[2]); }

/// Heading, then pitch, then roll (z-y'-x''), degrees.
std::array<double, 3> yaw_pitch_roll_deg(const std::array<double, 4>& wxyz) {
  const Eigen::Matrix3d R =
      Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).toRotationMatrix();
  return {kDegreesPerRadian * std::atan2(R(1, 0), R(0, 0)),
          kDegreesPerRadian * std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0))),
          kDegreesPerRadian * std::atan2(R(2, 1), R(2, 2))};
}

std::string milliseconds(double seconds) {
  return std::isfinite(seconds) ? fixed(1000 * seconds, 2) + " ms" : "unknown";
}

std::string column_names() {
  return "body             state    " + fmt::format(kColumns, "x [m]", "y [m]", "z [m]", "yaw[deg]",
                                                    "pitch", "roll", "[m/s]", "[deg/s]", "1s [mm]",
                                                    "1s[deg]", "age[ms]", "tags");
}

std::string row(const Body& body) {
  std::array<char, 96> head{};
  std::snprintf(head.data(), head.size(), "%-16.32s %-9s", body.name.c_str(),
                name_of(body.tracking));
  const auto text = [](bool is_shown, double value, int decimals) {
    return is_shown && std::isfinite(value) ? fixed(value, decimals) : "-";
  };
  // Invalid poses are not shown.
  const auto shown = [&](double value, int decimals) { return text(body.valid, value, decimals); };
  const auto& [x, y, z] = body.position_m;
  const auto [yaw, pitch, roll] = yaw_pitch_roll_deg(body.orientation_wxyz);
  return head.data() + fmt::format(kColumns, shown(x, 3), shown(y, 3), shown(z, 3), shown(yaw, 1),
                                   shown(pitch, 1), shown(roll, 1),
                                   shown(length(body.velocity_m_s), 2),
                                   shown(kDegreesPerRadian * length(body.body_rate_rad_s), 0),
                                   shown(1000 * body.position_sigma_m, 1),
                                   shown(kDegreesPerRadian * body.rotation_sigma_rad, 2),
                                   text(true, 1000 * body.age_s, 0), body.tags_in_view);
}

std::string summary(const Frame& frame, const ClientStatistics& s) {
  return fmt::format("frame {}  {:.1f} Hz  latency p50 {} p99 {}  lost {}  map v{}", frame.number,
                     s.rate_hz, milliseconds(s.latency_p50_s), milliseconds(s.latency_p99_s),
                     s.lost, frame.map_version);
}

using SteadyTime = std::chrono::steady_clock::time_point;
constexpr std::chrono::seconds kTimeout{2};  // without a frame, then it is reported
constexpr std::chrono::milliseconds kLivePeriod{100};
constexpr std::chrono::seconds kLinePeriod{1};
constexpr std::uint64_t kBlocksPerNames = 20;  // headings in a file

class Watch final {
 public:
  Watch(const ServerAddress& address, bool json, const Terminal& terminal)
      : name_(address.host + ":" + std::to_string(address.port)),
        json_(json),
        terminal_(terminal),
        client_(client_options(address, "fiducap watch")) {
    if (json_) client_.on_frame([this](const Frame& frame) { queue_.push(frame); });
  }

  int run(double duration_s) {
    const SteadyTime start = last_frame_;
    while (!interrupted() && terminal_.out && !is_over(start, duration_s)) {
      const SteadyTime now = std::chrono::steady_clock::now();
      if (receive()) {
        newest_ = frame_.number;
        last_frame_ = now;
        seen_ = true;
        reported_ = false;
      } else if (now - last_frame_ > kTimeout) {
        report_silence();
      }
      if (seen_) show(now);
    }
    if (!seen_) report_silence();
    return seen_ ? kExitOk : kExitFailed;
  }

 private:
  /// Waits for a frame: the next one for JSON, else the newest.
  bool receive() {
    constexpr std::chrono::milliseconds kWait{100};
    if (!json_) return client_.wait_for_frame(newest_, kWait) && client_.latest(frame_);
    auto next = queue_.pop(kWait);
    if (next) frame_ = std::move(*next);
    return next.has_value();
  }

  void report_silence() {
    if (reported_) return;
    reported_ = true;
    const std::string problem = client_.statistics().problem;
    terminal_.err << "fiducap: no Fiducap server answers at " << name_
                  << (problem.empty() ? "" : " (" + problem + ")")
                  << ". Start one (fiducapd --config config/demo.yaml), check its streaming.native "
                     "section, or name another with --server HOST:PORT."
                  << std::endl;
    lines_shown_ = 0;  // the message has scrolled the screen
  }

  void show(SteadyTime now) {
    if (json_) {
      if (frame_.number == shown_frame_) return;
      terminal_.out << watch_json(frame_, client_.statistics(), queue_.skipped()) << std::flush;
    } else if (terminal_.out_is_live) {
      if (now - last_shown_ < kLivePeriod) return;
      redraw(watch_table(name_, frame_, client_.statistics()));
    } else {
      if (now - last_shown_ < kLinePeriod || frame_.number == shown_frame_) return;
      const bool with_names = blocks_++ % kBlocksPerNames == 0;
      terminal_.out << watch_lines(frame_, client_.statistics(), with_names) << std::flush;
    }
    shown_frame_ = frame_.number;
    last_shown_ = now;
  }

  /// Redraws the table in place and clears the rest of the screen.
  void redraw(const std::string& table) {
    std::string text;
    if (lines_shown_ > 0) text += "\x1b[" + std::to_string(lines_shown_) + "A\r";
    for (std::string_view rest = table; !rest.empty();) {
      const std::size_t end = std::min(rest.find('\n'), rest.size() - 1);
      text += printable(rest.substr(0, end)) + "\x1b[K\n";
      rest.remove_prefix(end + 1);
    }
    draw(terminal_.out, text + "\x1b[J");
    lines_shown_ = std::count(table.begin(), table.end(), '\n');
  }

  std::string name_;
  bool json_;
  const Terminal& terminal_;
  FrameQueue queue_;
  Client client_;
  Frame frame_;
  std::uint64_t newest_{0};
  std::uint64_t shown_frame_{0};
  SteadyTime last_frame_{std::chrono::steady_clock::now()};
  SteadyTime last_shown_{};
  std::ptrdiff_t lines_shown_{0};
  std::uint64_t blocks_{0};  ///< Of lines, to a file.
  bool seen_{false};
  bool reported_{false};
};

int run_watch(const WatchArguments& arguments, const Terminal& terminal) {
  const auto address = parse_server_address(arguments.server, ClientOptions{}.port);
  if (!address) {
    report(terminal, address.error());
    return kExitUsage;
  }
  catch_interrupt();
  return Watch(*address, arguments.json, terminal).run(arguments.duration_s);
}

}  // namespace

std::string watch_table(const std::string& server, const Frame& frame,
                        const ClientStatistics& statistics) {
  std::string text = server + (statistics.connected ? "  " : "  NOT ANSWERING  ") +
                     summary(frame, statistics) + "\n";
  text += column_names();
  for (const Body& body : frame.bodies) text += row(body);
  if (frame.bodies.empty()) text += "(the server has no bodies)\n";
  return text;
}

std::string watch_lines(const Frame& frame, const ClientStatistics& statistics, bool with_names) {
  std::string text = summary(frame, statistics) + "\n";
  if (with_names) text += "  " + column_names();
  for (const Body& body : frame.bodies) text += "  " + row(body);
  return text;
}

std::string watch_json(const Frame& frame, const ClientStatistics& statistics,
                       std::uint64_t skipped) {
  // nlohmann writes NaN as null.
  nlohmann::ordered_json json{{"frame", frame.number},
                              {"at_server_ns", frame.at_server_ns},
                              {"at_utc_ns", frame.at_utc_ns},
                              {"map_version", frame.map_version},
                              {"server_rate_hz", frame.rate_hz},
                              {"received_rate_hz", statistics.rate_hz},
                              {"lost", statistics.lost},
                              {"skipped", skipped},
                              {"latency_p50_s", statistics.latency_p50_s},
                              {"latency_p99_s", statistics.latency_p99_s},
                              {"bodies", nlohmann::ordered_json::array()}};
  for (const Body& body : frame.bodies)
    json["bodies"].push_back({{"id", body.id},
                              {"name", body.name},
                              {"tracking", name_of(body.tracking)},
                              {"valid", body.valid},
                              {"position_m", body.position_m},
                              {"orientation_wxyz", body.orientation_wxyz},
                              {"velocity_m_s", body.velocity_m_s},
                              {"body_rate_rad_s", body.body_rate_rad_s},
                              {"acceleration_m_s2", body.acceleration_m_s2},
                              {"position_sigma_m", body.position_sigma_m},
                              {"rotation_sigma_rad", body.rotation_sigma_rad},
                              {"age_s", body.age_s},
                              {"tags_in_view", body.tags_in_view}});
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void FrameQueue::push(const Frame& frame) {
  {
    const std::lock_guard lock(mutex_);
    if (frames_.size() < kMost)
      frames_.push_back(frame);
    else
      ++skipped_;
  }
  came_.notify_one();
}

std::optional<Frame> FrameQueue::pop(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  if (!came_.wait_for(lock, timeout, [this] { return !frames_.empty(); })) return std::nullopt;
  Frame frame = std::move(frames_.front());
  frames_.pop_front();
  return frame;
}

std::uint64_t FrameQueue::skipped() const {
  const std::lock_guard lock(mutex_);
  return skipped_;
}

bool is_over(SteadyTime start, double limit_s) {
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
  return limit_s > 0 && passed.count() >= limit_s;
}

ClientOptions client_options(const ServerAddress& address, const char* name) {
  ClientOptions options;
  options.server = address.host;
  options.port = address.port;
  options.name = name;
  return options;
}

Expected<ServerAddress> parse_server_address(std::string_view text, std::uint16_t default_port) {
  const auto wrong = fail(ErrorCode::kInvalid,
                          "--server must be HOST or HOST:PORT, is '" + std::string(text) + "'");
  ServerAddress address{std::string(text), default_port};
  const bool bracketed = text.starts_with('[');
  const std::size_t close = bracketed ? text.find(']') : 0;
  if (close == std::string_view::npos) return wrong;
  if (bracketed) address.host = text.substr(1, close - 1);
  const std::size_t colon = text.find(':', close);
  // More than one colon without brackets is a bare IPv6 address.
  const bool bare_ipv6 = !bracketed && colon != std::string_view::npos &&
                         text.find(':', colon + 1) != std::string_view::npos;
  if (colon != std::string_view::npos && !bare_ipv6) {
    if (!bracketed) address.host = text.substr(0, colon);
    if (!parse_number(text.substr(colon + 1), address.port) || address.port == 0) return wrong;
  } else if (bracketed && close + 1 != text.size()) {
    return wrong;
  }
  if (address.host.empty()) return wrong;
  return address;
}

void add_watch(CLI::App& app, ChosenVerb& chosen) {
  auto* verb =
      app.add_subcommand("watch", "Live poses, rates, latency and loss as a client receives them");
  auto& a = arguments_of<WatchArguments>(*verb, chosen, run_watch);
  add_server_option(*verb, a.server);
  add_positive(*verb, "--duration", a.duration_s,
               "End after this many seconds; fails when nothing arrived");
  verb->add_flag(
      "--json", a.json,
      "One JSON object per frame and line; lost: on the way, skipped: for a slow output");
  verb->footer(
      "Example:\n  fiducap watch --server robot-hall:21600\n"
      "  fiducap watch --json --duration 10 | jq '.bodies[0].position_m'");
}

}  // namespace fiducap
