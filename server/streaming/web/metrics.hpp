#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>

#include "base/event_board.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/web/client_tally.hpp"

// `/metrics`: what a monitoring system watches.
namespace fiducap::web {

enum class MetricsFormat {
  kPrometheus,   ///< Prometheus text exposition format 0.0.4
  kOpenMetrics,  ///< OpenMetrics 1.0.0
};

/// @param accept  of the request
[[nodiscard]] MetricsFormat metrics_format(std::string_view accept);
[[nodiscard]] std::string_view content_type_of(MetricsFormat format);

/// What the process takes of the machine.
struct ProcessUse {
  std::uint64_t resident_bytes{};
  std::uint64_t open_fds{};
};
/// Of this process.
[[nodiscard]] ProcessUse process_use();

struct MetricsParts {
  std::string_view version{};
  bool healthy{};
  const SceneFrame* frame{};  ///< The newest; nullptr: there was none.
  const SceneModel* model{};
  const std::map<std::string, Traffic>& protocols;
  std::span<const Event> alarms{};        ///< Standing conditions.
  std::array<std::uint64_t, 3> events{};  ///< Told since the start, by Severity.
  ProcessUse process{};
};

/// Units are in the names. Of a body that was never placed, sigmas and age are missing.
[[nodiscard]] std::string encode_metrics(const MetricsParts& parts, MetricsFormat format);

}  // namespace fiducap::web
