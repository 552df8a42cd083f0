#include "streaming/web/metrics.hpp"

#include <unistd.h>

#include <cmath>
#include <fstream>
#include <initializer_list>
#include <limits>

#include <fmt/format.h>

#include "base/process.hpp"
#include "base/time.hpp"
#include "streaming/web/codec.hpp"

namespace fiducap::web {

namespace {

constexpr std::array kStates{BodyState::kSearching, BodyState::kTracking, BodyState::kCoasting,
                             BodyState::kLost};
constexpr std::array kSeverities{Severity::kInfo, Severity::kWarning, Severity::kError};

using Label = std::pair<std::string_view, std::string_view>;

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\' || c == '"') out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else {
      out += c;
    }
  }
  return out;
}

/// Writes families one after the other: a head, then its samples.
class Writer final {
 public:
  explicit Writer(MetricsFormat format) : format_(format) {}

  void gauge(std::string_view name, std::string_view help) { begin(name, "gauge", help, ""); }
  /// @param name  without `_total`
  void counter(std::string_view name, std::string_view help) {
    begin(name, "counter", help, "_total");
  }
  void sample(double value, std::initializer_list<Label> labels = {}) {
    if (std::isfinite(value)) add(fmt::format("{:.9g}", value), labels);
  }
  void sample(std::uint64_t value, std::initializer_list<Label> labels = {}) {
    add(std::to_string(value), labels);
  }
  [[nodiscard]] std::string end() {
    if (format_ == MetricsFormat::kOpenMetrics) out_ += "# EOF\n";
    return std::move(out_);
  }

 private:
  // A family of OpenMetrics is named without the suffix of its samples, one of Prometheus with it.
  void begin(std::string_view name, std::string_view type, std::string_view help,
             std::string_view suffix) {
    sample_ = fmt::format("{}{}", name, suffix);
    const std::string_view family = format_ == MetricsFormat::kOpenMetrics ? name : sample_;
    out_ += fmt::format("# HELP {0} {1}\n# TYPE {0} {2}\n", family, help, type);
  }
  void add(const std::string& value, std::initializer_list<Label> labels) {
    out_ += sample_;
    char before = '{';
    for (const auto& [name, text] : labels) {
      out_ += fmt::format("{}{}=\"{}\"", before, name, escaped(text));
      before = ',';
    }
    out_ += (labels.size() == 0 ? " " : "} ") + value + "\n";
  }

  MetricsFormat format_;
  std::string sample_;
  std::string out_;
};

/// One family with a sample per body. @param value  of a body
template <typename Value>
void add_bodies(Writer& out, const MetricsParts& parts, Value&& value) {
  if (parts.frame == nullptr || parts.model == nullptr) return;
  for (std::size_t i = 0; i < parts.frame->bodies.size() && i < parts.model->bodies.size(); ++i)
    value(parts.frame->bodies[i], Label{"body", parts.model->bodies[i].name}, out);
}

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();  // not written

/// One gauge with a sample per body.
void add_gauge(Writer& out, const MetricsParts& parts, std::string_view name, std::string_view help,
               double (*value)(const BodyPose&)) {
  out.gauge(name, help);
  add_bodies(out, parts, [value](const BodyPose& body, Label label, Writer& to) {
    to.sample(value(body), {label});
  });
}

void add_poses(Writer& out, const MetricsParts& parts) {
  add_gauge(out, parts, "fiducap_body_valid", "1: the pose may be used.",
            [](const BodyPose& body) -> double { return body.valid ? 1.0 : 0.0; });
  out.gauge("fiducap_body_state", "1 for the state that the body is in.");
  add_bodies(out, parts, [](const BodyPose& body, Label name, Writer& to) {
    for (const BodyState state : kStates)
      to.sample(std::uint64_t{body.state == state}, {name, {"state", name_of(state)}});
  });
  add_gauge(
      out, parts, "fiducap_body_age_seconds", "Since the last image with a used tag.",
      [](const BodyPose& body) -> double { return had_pose(body) ? to_seconds(body.age) : kNone; });
  add_gauge(out, parts, "fiducap_body_position_sigma_meters", "Largest axis, 1 sigma.",
            [](const BodyPose& body) -> double {
              return had_pose(body) ? body.position_sigma_m() : kNone;
            });
  add_gauge(out, parts, "fiducap_body_rotation_sigma_radians", "Largest axis, 1 sigma.",
            [](const BodyPose& body) -> double {
              return had_pose(body) ? body.rotation_sigma_rad() : kNone;
            });
}

void add_images(Writer& out, const MetricsParts& parts) {
  add_gauge(out, parts, "fiducap_body_image_rate_hertz", "Images per second.",
            [](const BodyPose& body) -> double { return body.image_rate_hz; });
  add_gauge(out, parts, "fiducap_body_processing_seconds",
            "Arrival of the newest image to its update.",
            [](const BodyPose& body) -> double { return to_seconds(body.processing); });
  add_gauge(out, parts, "fiducap_body_tags_in_view", "Tags used in the newest image.",
            [](const BodyPose& body) -> double { return body.tags_in_view; });
  out.counter("fiducap_body_images_dropped", "Images that were not processed.");
  add_bodies(out, parts, [](const BodyPose& body, Label name, Writer& to) {
    to.sample(body.images_dropped, {name});
  });
}

void add_protocols(Writer& out, const MetricsParts& parts) {
  const auto add_each = [&](std::uint64_t Traffic::*count) {
    for (const auto& [name, traffic] : parts.protocols)
      out.sample(traffic.*count, {{"protocol", name}});
  };
  out.gauge("fiducap_protocol_clients", "Clients now.");
  add_each(&Traffic::clients);
  out.counter("fiducap_protocol_frames_sent", "Frames sent, of all clients.");
  add_each(&Traffic::sent);
  out.counter("fiducap_protocol_frames_dropped", "Frames that slow clients lost.");
  add_each(&Traffic::dropped);
}

void add_events(Writer& out, const MetricsParts& parts) {
  out.gauge("fiducap_alarm", "1 while a condition holds.");
  for (const Event& alarm : parts.alarms)
    out.sample(
        std::uint64_t{1},
        {{"subject", alarm.subject}, {"kind", alarm.kind}, {"severity", name_of(alarm.severity)}});
  out.counter("fiducap_events", "Events since the start.");
  for (const Severity severity : kSeverities)
    out.sample(parts.events[static_cast<std::size_t>(severity)], {{"severity", name_of(severity)}});
}

}  // namespace

MetricsFormat metrics_format(std::string_view accept) {
  const bool open = accept.find("application/openmetrics-text") != std::string_view::npos;
  return open ? MetricsFormat::kOpenMetrics : MetricsFormat::kPrometheus;
}

std::string_view content_type_of(MetricsFormat format) {
  return format == MetricsFormat::kOpenMetrics
             ? "application/openmetrics-text; version=1.0.0; charset=utf-8"
             : "text/plain; version=0.0.4; charset=utf-8";
}

ProcessUse process_use() {
  ProcessUse use;
  std::uint64_t pages{};
  std::uint64_t resident_pages{};
  if (std::ifstream("/proc/self/statm") >> pages >> resident_pages)
    use.resident_bytes = resident_pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  use.open_fds = open_descriptors().size();
  return use;
}

std::string encode_metrics(const MetricsParts& parts, MetricsFormat format) {
  Writer out(format);
  out.gauge("fiducap_build_info", "1; what runs here.");
  out.sample(std::uint64_t{1}, {{"version", parts.version}});
  out.gauge("fiducap_healthy", "1: frames flow, as in /healthz.");
  out.sample(std::uint64_t{parts.healthy});
  out.counter("fiducap_frames_published", "Frames of all bodies made since the start.");
  out.sample(parts.frame == nullptr ? std::uint64_t{0} : parts.frame->number);
  add_poses(out, parts);
  add_images(out, parts);
  add_protocols(out, parts);
  add_events(out, parts);
  out.gauge("fiducap_process_resident_bytes", "Memory in use.");
  out.sample(parts.process.resident_bytes);
  out.gauge("fiducap_process_open_fds", "Open file descriptors.");
  out.sample(parts.process.open_fds);
  return out.end();
}

}  // namespace fiducap::web
