#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/event_board.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/streamer.hpp"

// `/metrics`, for monitoring systems.
namespace fiducap::web {

/// Counts of one protocol since the start.
struct Traffic {
  std::uint64_t clients{};  ///< Now.
  std::uint64_t sent{};     ///< Frames, also of clients that left.
  std::uint64_t dropped{};
};

/// Sums the counts of all clients, also of those that left, from repeated lists of clients; clients
/// that come and go between two lists are missed.
class ClientTally final {
 public:
  void note(std::span<const ClientStatus> clients) {
    std::map<std::string, Counters> now;
    for (auto& [protocol, traffic] : traffic_) traffic.clients = 0;
    for (const auto& client : clients) {
      std::string key = client.protocol + ' ' + client.peer;
      const auto known = known_.find(key);
      const Counters before = known == known_.end() ? Counters{} : known->second;
      Traffic& traffic = traffic_[client.protocol];
      ++traffic.clients;
      traffic.sent += increase(before.sent, client.frames_sent);
      traffic.dropped += increase(before.dropped, client.frames_dropped);
      now.insert_or_assign(std::move(key), Counters{client.frames_sent, client.frames_dropped});
    }
    known_ = std::move(now);
  }
  /// By protocol.
  [[nodiscard]] const std::map<std::string, Traffic>& traffic() const { return traffic_; }

 private:
  struct Counters {
    std::uint64_t sent{};
    std::uint64_t dropped{};
  };
  /// A lower count is that of another client of the same address.
  static std::uint64_t increase(std::uint64_t before, std::uint64_t now) {
    return now < before ? now : now - before;
  }

  std::map<std::string, Counters> known_;
  std::map<std::string, Traffic> traffic_;
};

enum class MetricsFormat {
  kPrometheus,   ///< Prometheus text exposition format 0.0.4
  kOpenMetrics,  ///< OpenMetrics 1.0.0
};

/// @param accept  of the request
[[nodiscard]] MetricsFormat metrics_format(std::string_view accept);
[[nodiscard]] std::string_view content_type_of(MetricsFormat format);

/// Resources of this process.
struct ProcessUse {
  std::uint64_t resident_bytes{};
  std::uint64_t open_fds{};
};
[[nodiscard]] ProcessUse process_use();

struct MetricsParts {
  std::string_view version{};
  bool healthy{};
  const SceneFrame* frame{};  ///< The newest; nullptr: none.
  const SceneModel* model{};
  const std::map<std::string, Traffic>& protocols;
  std::span<const Event> alarms{};        ///< Current conditions.
  std::array<std::uint64_t, 3> events{};  ///< Since the start, by Severity.
  ProcessUse process{};
};

/// Units are in the names. A body that never had a pose has no sigmas and age.
[[nodiscard]] std::string encode_metrics(const MetricsParts& parts, MetricsFormat format);

}  // namespace fiducap::web
