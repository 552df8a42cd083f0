#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene_frame.hpp"

namespace fiducap {

/// Transliteration to ASCII: ö → oe, é → e, ж → zh; others by number, 日 → u65e5. Letters, digits
/// and _ only, never empty.
/// @pre c is not ASCII
[[nodiscard]] std::string ascii_of(char32_t c);

/// What a protocol allows in a body's name.
struct NameRule {
  std::size_t max_bytes{127};
  std::string_view forbidden{};  ///< Characters; control characters always are.
  bool ascii_only{false};
  bool spaces{true};
};

/// Names for the clients of one protocol, by our name.
using NameAliases = std::map<std::string, std::string>;

/// One name that obeys the rule: its alias if there is one, forbidden letters by ascii_of, other
/// forbidden characters as `_`, cut at a whole UTF-8 character. Never empty.
[[nodiscard]] std::string client_name(const std::string& name, const NameRule& rule,
                                      const NameAliases& aliases = {});

/// Makes names distinct: unchanged names are kept, others that are equal to one end in `_2`, `_3`,
/// … The same in every run.
/// @pre fit has one per body of the model, none empty
[[nodiscard]] std::vector<std::string> make_distinct(const SceneModel& model,
                                                     const NameAliases& aliases,
                                                     const std::vector<std::string>& fit,
                                                     std::size_t max_bytes);

/// The client names of a scene, in the order of its bodies; distinct.
[[nodiscard]] std::vector<std::string> client_names(const SceneModel& model, const NameRule& rule,
                                                    const NameAliases& aliases = {});

}  // namespace fiducap
