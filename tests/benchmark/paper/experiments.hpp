#pragma once

#include "paper/paper_run.hpp"

namespace fiducap::bench {

/// The paper's three tags on a table: errors of tags and motion.
[[nodiscard]] PaperResult table_experiment(const PaperOptions& options);
/// Three tags in a room of 4 m, fast, a fifth of the images without any; also velocity and body
/// rate against differences of a motion capture system's poses.
[[nodiscard]] PaperResult dataset_1_experiment(const PaperOptions& options);
/// 36 tags on a round trip of 70 m.
[[nodiscard]] PaperResult cube_experiment(const PaperOptions& options);
/// 33 tags on 80 m, half of it in daylight.
[[nodiscard]] PaperResult pavillon_experiment(const PaperOptions& options);
/// The simulator's hall: not the paper's, but many tags at once.
[[nodiscard]] PaperResult hall_experiment(const PaperOptions& options);
/// Camera extrinsics from a poor start, by the running filter and by `fiducap calibrate
/// extrinsics`.
[[nodiscard]] PaperResult extrinsics_experiment(const PaperOptions& options);

}  // namespace fiducap::bench
