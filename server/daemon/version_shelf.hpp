#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "base/expected.hpp"
#include "mapping/store/map_rows.hpp"
#include "mapping/tag_map.hpp"

namespace fiducap {

/// The versions of a store for those who may not wait for its disk: the list as it was last, and
/// the few versions that were asked for last. Who keeps the store puts them here. Thread-safe.
class VersionShelf final {
 public:
  using Log = std::vector<MapVersionInfo>;
  using Content = Expected<std::shared_ptr<const TagMap>>;

  /// Newest first; never nullptr.
  [[nodiscard]] std::shared_ptr<const Log> log() const;
  [[nodiscard]] bool has(std::int64_t version) const;
  /// @return nullptr: it is being read, ask again in a moment; Error `kNotFound` when there is none
  [[nodiscard]] Content version(std::int64_t version);

  void put_log(Log log);
  /// Asked for and not here, since the last call.
  [[nodiscard]] std::vector<std::int64_t> take_wanted();
  void put(std::int64_t version, Content content);

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Log> log_{std::make_shared<const Log>()};
  std::vector<std::int64_t> wanted_;
  std::deque<std::pair<std::int64_t, Content>> here_;
};

}  // namespace fiducap
