#pragma once

#include "tools/replay/map_build_command.hpp"
#include "tools/tags/map_command.hpp"
#include "tools/tags/map_edit_command.hpp"
#include "tools/terminal.hpp"

namespace CLI {
class App;
}

namespace fiducap {

struct MapVerbs {
  MapArguments store;
  MapBuildArguments build;
  MapEditArguments edit;
};

/// Adds `fiducap map …`. @param verbs, chosen  outlive `app`
void add_map(CLI::App& app, MapVerbs& verbs, ChosenVerb& chosen);

}  // namespace fiducap
