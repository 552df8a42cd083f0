// Replaces iio_source.cpp without libiio.
#include "capture/imu/imu_source.hpp"

namespace fiducap {

OpenedSource open_iio_source(const IioConfig& config, const Clock&) {
  return fail(ErrorCode::kUnsupported,
              "this server was built without libiio: install libiio-dev and build it again",
              config.uri);
}

}  // namespace fiducap
