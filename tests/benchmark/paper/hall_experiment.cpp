// No experiment of the paper: the simulator's hall, many tags in an image at once.
#include "paper/experiments.hpp"

namespace fiducap::bench {

PaperResult hall_experiment(const PaperOptions& options) {
  SimulatedDataSetup setup;
  setup.world = "hall";
  setup.seconds = options.seconds(60, 20);
  const PaperRuns runs = run_all(options, setup);
  PaperResult result{"hall"};
  add_figure(result, {"position RMSE", "mm", "-", "-", {}, 2}, runs, [](const PaperRun& r) {
    return kMm * r.run.scored_after(kSettled_s).rms([](const auto& at) { return at.position_m; });
  });
  add_honesty(result, runs);
  return result;
}

}  // namespace fiducap::bench
