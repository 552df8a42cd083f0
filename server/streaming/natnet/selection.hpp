#pragma once

#include <optional>
#include <string_view>
#include <utility>
#include <vector>

namespace fiducap::natnet {

/// Which bodies one unicast client wants: the outcome of its subscription commands.
///
/// Strongest first: a single body by name or id; all or none of the rigid bodies; all or none of all types; the
/// server's default, which is everything until the client says "subscribed data only".
class Selection final {
 public:
  void only_subscribed() { subscribed_only_ = true; }
  void all_types(bool wanted) { all_types_ = wanted; }
  void rigid_bodies(bool wanted) { rigid_bodies_ = wanted; }
  void body(int id, bool wanted);
  /// Back to the default; "subscribed data only" goes too.
  void clear() { *this = {}; }

  [[nodiscard]] bool has(int id) const;
  /// No body is left out: the usual case, encoded for many clients at once.
  [[nodiscard]] bool is_everything() const;
  [[nodiscard]] bool operator==(const Selection&) const = default;

 private:
  [[nodiscard]] bool by_default() const;

  bool subscribed_only_{false};
  std::optional<bool> all_types_;
  std::optional<bool> rigid_bodies_;
  std::vector<std::pair<int, bool>> bodies_;  ///< Sorted by id; at most one per body of the scene.
};

}  // namespace fiducap::natnet
