#pragma once

#include <array>

#include <Eigen/Core>

#include "capture/lens/lens_offset.hpp"
#include "estimation/world/state_layout.hpp"

/// How cameras and prints differ from what the configuration says of them, as the state has it.
namespace fiducap::world {

/// When the rows of a camera's images were exposed.
struct CameraClock {
  double
      shift_s{};  ///< t_imu = stamp + shift; what the configuration knows is in the stamps already.
  double readout_s{};  ///< First row to last row; 0: global shutter. The shift is that of the
                       ///< middle row.
  double applied_s{};  ///< So much of the shift is already in the present image's time (not
                       ///< estimated).
  /// The rows are, or may be, exposed in turn: each corner has its own moment. False: what the
  /// readout may be all the same (Suspects) is taken to first order.
  bool rows_apart{false};
  double jitter_s{};  ///< 1-sigma by which each image's stamp is off on its own (NoiseWatch).

  /// From the state's instant to the exposure of a row. @param row  −0.5 first … +0.5 last
  [[nodiscard]] double seconds_to(double row) const {
    return shift_s - applied_s + row * readout_s;
  }
};

/// How prints differ from their configured size, relative.
struct PrintSizes {
  struct Watched {
    int tag_id{-1};  ///< -1: free
    double scale{};  ///< Beyond `common`.
  };
  double common{};
  std::array<Watched, layout::kWatchedPrints> watched;

  /// Index in `watched`, or -1.
  [[nodiscard]] int find(int tag_id) const;
  /// So many times the configured size.
  [[nodiscard]] double factor(int tag_id) const;
};

/// How far the suspicion against one number of the configuration has come (Suspects).
struct Suspicion {
  bool is_open{false};
  int images_beyond{0};  ///< In a row.
  int images_open{0};
};

}  // namespace fiducap::world
