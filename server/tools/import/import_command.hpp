#pragma once

#include "tools/import/import_plan.hpp"
#include "tools/terminal.hpp"

namespace CLI {
class App;
}

namespace fiducap {

/// `fiducap import`: a recording out of what another program recorded. Looks through the source,
/// says what is there, writes what was chosen, checks it, and says what is still missing.
/// @return exit code; without `--out` only looks
int run_import(const ImportArguments& arguments, const Terminal& terminal);

/// Adds the verb. @param arguments, chosen  outlive `app`
void add_import(CLI::App& app, ImportArguments& arguments, ChosenVerb& chosen);

}  // namespace fiducap
