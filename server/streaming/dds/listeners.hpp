#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "middleware/participant.hpp"
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
  /// A topic's writer at the last look. One that was made anew, for another model, counts from
  /// zero.
  struct Count {
    std::int32_t writer{};
    std::uint64_t written{};
    std::uint64_t refused{};
  };
  struct Listener {
    Instant since{};
    std::set<std::string> topics;
    std::map<std::string, Count> before;
    std::uint64_t sent{};  ///< Messages since it came, of all topics.
    std::uint64_t refused{};
  };

  const Clock& clock_;
  std::map<std::string, Listener> by_participant_;
};

}  // namespace fiducap::dds
