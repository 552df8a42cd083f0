#pragma once

#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "base/time.hpp"

namespace fiducap {

/// That a tag is not in its place any more.
struct TagSuspicion {
  int tag_id{};
  std::optional<Instant> fitted_at{};  ///< When a body last found it there; nullopt: none did.
  Instant first_word_at{};
  Instant at{};      ///< Of the word that decided.
  std::set<int> by;  ///< Bodies.
};

/// Whether a tag of the map is gone from its place, by the words of all bodies.
///
/// A body's filter gives up a tag when it contradicts image after image that other tags fit. That
/// alone decides nothing: a body that has gone astray contradicts one tag after the other, finds
/// its way among what it maps meanwhile, and would take the map apart. But such a body agrees with
/// few tags of the *map*, and contradicts several. So a word counts only when its body has just
/// found two other tags of the map in their places, and three times as many as it contradicts when
/// those are several; when it has not, all of its words are taken back. It takes three words;
/// whoever finds the tag in its place, together with another one, takes them back: a tag cannot
/// have moved for one body and not for another.
class TagWatch final {
 public:
  /// What a body said of an image. @param fitting  tags found where the map has them
  /// @param contradicted  tags of the map that its filter gave up
  /// @return the tags that are gone by now; they are asked about anew
  [[nodiscard]] std::vector<TagSuspicion> hear(int body_id, Instant at,
                                               std::span<const int> fitting,
                                               std::span<const int> contradicted);
  /// The tag has another place: what was said of the old one is void.
  void forget(int tag_id);

 private:
  struct Word {
    int body_id{};
    Instant at{};
  };
  struct OfTag {
    std::optional<Instant> fitted_at{};        ///< Together with another tag …
    std::optional<Instant> fitted_alone_at{};  ///< … or so: whatever a body sees fits it then.
    std::vector<Word> words{};
  };
  using Times = std::map<int, Instant>;  ///< By tag.
  struct OfBody {
    Times fitted{};
    Times contradicted{};
  };
  [[nodiscard]] static bool is_believed(OfBody& body, Instant at);
  void take_back_words_of(int body_id);
  [[nodiscard]] std::optional<TagSuspicion> judge(int tag_id, Instant at);

  std::map<int, OfTag> tags_;
  std::map<int, OfBody> bodies_;
};

}  // namespace fiducap
