#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "scene/scene_frame.hpp"

namespace fiducap {

/// What a protocol can carry in a body's name.
struct NameRule {
  std::size_t max_bytes{127};
  std::string_view forbidden{};  ///< Characters; control characters always are.
  bool ascii_only{false};
  bool spaces{true};
};

/// Name that clients of a protocol see, by our name.
using NameAliases = std::map<std::string, std::string>;

/// One name made fit: its alias if there is one, letters that the rule forbids as ASCII writes them
/// (ascii_of), every other character that it forbids as `_`, cut at a whole UTF-8 character. Never
/// empty.
[[nodiscard]] std::string client_name(const std::string& name, const NameRule& rule,
                                      const NameAliases& aliases = {});

/// Names made fit, told apart: who fits as it is keeps its name, then a later one that became equal
/// to another ends in `_2`, `_3`, …. The same in every run.
/// @pre fit has one per body of the model, none empty
[[nodiscard]] std::vector<std::string> told_apart(const SceneModel& model,
                                                  const NameAliases& aliases,
                                                  const std::vector<std::string>& fit,
                                                  std::size_t max_bytes);

/// The names of a scene in the order of its bodies, fit and told apart.
[[nodiscard]] std::vector<std::string> client_names(const SceneModel& model, const NameRule& rule,
                                                    const NameAliases& aliases = {});

}  // namespace fiducap
