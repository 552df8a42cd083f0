#pragma once

#include <span>

#include "tools/plot/plot_page.hpp"
#include "tools/replay/run_files.hpp"

namespace fiducap {

/// What a run looks like: the map from above with the ways of all bodies; for each body over time
/// how sure it was, how many tags it saw, where poses are missing and what happened; figures and
/// what was said. `plots.html` of a run, see to_html.
[[nodiscard]] PlotPage run_plots(std::span<const RunBody> bodies, const OfflineSession& session);

}  // namespace fiducap
