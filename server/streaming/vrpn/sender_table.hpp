#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_check.hpp"
#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"

namespace fiducap::vrpn {

/// @return every rule that a body's name breaks for VRPN: 1 to 95 bytes, no `@` (it separates name
/// and host), no control
///         bytes, not `VRPN Control`; empty when usable.
/// @param path  where the name stands in the configuration, e.g. `bodies[2].name`
[[nodiscard]] std::vector<ConfigError> check_body_name(const std::string& path,
                                                       std::string_view name);

/// Which sender id belongs to which name, for the life of the server. Sender 0 is `VRPN Control`,
/// bodies follow without holes. An id is never given to another name: VRPN cannot take a sender
/// back, a body that is gone just stops reporting.
class SenderTable final {
 public:
  static constexpr std::int32_t kNone = -1;

  explicit SenderTable(NameAliases aliases = {});

  /// Takes over the bodies of a new generation; the same generation again does nothing.
  /// @return names that cannot be served (rule broken, doubled, ids used up), for the log.
  std::vector<std::string> update(const SceneModel& model);

  /// All names ever described, by id.
  [[nodiscard]] std::span<const std::string> names() const { return names_; }
  /// Sender id per body, in the order of the model; kNone for one that cannot be served.
  [[nodiscard]] std::span<const std::int32_t> of_bodies() const { return of_bodies_; }
  /// @return the id of a body of the current generation.
  [[nodiscard]] std::optional<std::int32_t> find_body(std::string_view name) const;
  /// What the body of a sender is called in the configuration. @pre of_bodies() has the id
  [[nodiscard]] const std::string& own_name_of(std::int32_t id) const;
  /// `a, b, c`, for people.
  [[nodiscard]] std::string list_bodies() const;

 private:
  [[nodiscard]] std::int32_t id_for(const std::string& name);

  NameAliases aliases_;
  std::optional<std::uint64_t> generation_;
  std::vector<std::string> names_;
  std::vector<std::int32_t> of_bodies_;
  std::vector<std::string> own_names_;  ///< As of_bodies_.
};

}  // namespace fiducap::vrpn
