#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "scene/scene_frame.hpp"
#include "streaming/conventions/client_names.hpp"

namespace fiducap::qualisys {

/// Which body is at which index of the data packets, for the life of the server.
///
/// The protocol knows bodies by index only, and many clients never read the list again. So a body
/// keeps its index: one that is disabled stays where it is (as NaN), a new one comes at the end.
class BodyTable final {
 public:
  struct Entry {
    int id{};
    std::string name;  ///< As clients see it.
    bool enabled{true};
  };

  BodyTable() = default;
  explicit BodyTable(NameAliases aliases) : aliases_(std::move(aliases)) {}

  /// Takes over a model. @return false when it is the same generation as before
  bool update(const SceneModel& model);

  [[nodiscard]] std::span<const Entry> entries() const { return entries_; }
  /// Where the i-th body of the model is.
  [[nodiscard]] std::span<const std::size_t> index_of_body() const { return index_of_body_; }

 private:
  NameAliases aliases_;
  std::optional<std::uint64_t> generation_;
  std::vector<Entry> entries_;
  std::vector<std::size_t> index_of_body_;
};

}  // namespace fiducap::qualisys
