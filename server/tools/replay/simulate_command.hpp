#pragma once

#include <cstdint>
#include <string>

#include "base/gravity.hpp"
#include "tools/terminal.hpp"

namespace fiducap {

struct SimulateArguments {
  std::string out;
  std::string room{"hall"};
  double seconds{60};
  std::uint64_t seed{1};
  bool images{false};  ///< Render images …
  bool corners{
      false};  ///< … or corners only, which is also what happens when nobody says anything.
  bool imu{true};
  double speed{1.0};
  double corner_noise_px{0.4};
  double gravity_m_s2{kUsualGravity_m_s2};  ///< As it is; the recording does not tell it.
  bool json{false};
};

/// `fiducap simulate`: a recording with truth. The calibration in it is off by 5 mm and 0.5
/// degrees, in a direction drawn by the seed; the true one lies in truth/. @return exit code
[[nodiscard]] int run_simulate(const SimulateArguments& arguments, const Terminal& terminal);

}  // namespace fiducap
