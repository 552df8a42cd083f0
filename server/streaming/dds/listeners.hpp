#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/dds/participant.hpp"
#include "streaming/streamer.hpp"

namespace fiducap::dds {

/// Who listens to what, by participant: DDS knows no connections, only readers that match. Looked
/// at when the page asks, at most a few times a second.
class Listeners final {
 public:
  explicit Listeners(const Clock& clock) : clock_(clock) {}

  /// A new look at all writers.
  void begin();
  void look_at(const Writer& writer);
  /// Those who were not seen in this look are forgotten.
  void append_to(std::vector<ClientStatus>& out);

 private:
  struct Listener {
    Instant since{};
    std::set<std::string> topics;
    /// Per topic: what the writer had written and refused when this one came.
    std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> before;
    std::uint64_t sent{};
    std::uint64_t refused{};
  };

  const Clock& clock_;
  std::map<std::string, Listener> by_participant_;
};

}  // namespace fiducap::dds
