#include "capture/imu/iio_config.hpp"

namespace fiducap {

void IioConfig::check(Checker& checker) const {
  const bool known = uri == "local:" || uri.starts_with("ip:") || uri.starts_with("usb:");
  checker
      .require(known, "uri", '"' + uri + '"',
               "must be local: (this machine), ip:ADDRESS (where iiod runs) or usb:")
      .within("rate_hz", rate_hz, 0, 10'000)
      .within("samples", samples, 1, 1024);
}

}  // namespace fiducap
