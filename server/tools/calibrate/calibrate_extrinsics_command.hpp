#pragma once

#include <string>

#include "tools/terminal.hpp"

namespace fiducap {

struct CalibrateExtrinsicsArguments {
  std::string recording;
  std::string out{"calibration"};
  double prior_mm{20};
  double prior_deg{2};
  bool keep_time{false};
  bool json{false};
};

/// `fiducap calibrate extrinsics`: writes camchain-imucam.yaml. @return exit code
[[nodiscard]] int run_calibrate_extrinsics(const CalibrateExtrinsicsArguments& arguments,
                                           const Terminal& terminal);

}  // namespace fiducap
