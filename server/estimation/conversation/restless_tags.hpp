#pragma once

#include <array>

#include "base/time.hpp"

namespace fiducap {

struct GivenUpTag {
  int tag_id{};
  bool was_proven{};
};

/// Tags that were given up more than once: they hang on something that moves, or their id is there
/// twice. Each time they have to stay away for longer. Remembers a few ids, the newest.
class RestlessTags final {
 public:
  void note_given_up(int tag_id, Instant at);
  /// It may not join, nor correct anything, for now.
  [[nodiscard]] bool is_barred(int tag_id, Instant now) const;
  void forget_all() { *this = RestlessTags{}; }

 private:
  struct Restless {
    int tag_id{-1};
    int times{0};
    Instant last{};
  };
  std::array<Restless, 64> tags_{};
  std::size_t next_{0};  ///< Written next, when there is a new one.
};

}  // namespace fiducap
