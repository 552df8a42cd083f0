#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace fiducap::bench {

/// Runs one verb of fiducap_bench. @return exit code
using Bench = std::function<int()>;

// Each adds the options of its verb. `quick`, which is set when the bench runs: enough to see that
// it works, too little to rely on.
[[nodiscard]] Bench add_stages(CLI::App& verb, const bool& quick);
[[nodiscard]] Bench add_detection(CLI::App& verb, const bool& quick);
[[nodiscard]] Bench add_bodies(CLI::App& verb, const bool& quick);
[[nodiscard]] Bench add_loop(CLI::App& verb, const bool& quick);
[[nodiscard]] Bench add_fanout(CLI::App& verb, const bool& quick);
[[nodiscard]] Bench add_map_store(CLI::App& verb, const bool& quick);

}  // namespace fiducap::bench
