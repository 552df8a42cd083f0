#include "capture/lens/lens_name.hpp"

#include <algorithm>
#include <optional>

namespace fiducap {
namespace {

std::optional<Distortion> distortion_of(const std::string& name) {
  if (name == "none") return Distortion::kNone;
  if (name == "radial-tangential" || name == "radtan" || name == "plumb_bob") {
    return Distortion::kRadialTangential;
  }
  if (name == "equidistant" || name == "equi" || name == "fisheye") return Distortion::kEquidistant;
  return std::nullopt;
}

}  // namespace

Expected<void> set_lens(CameraModel& camera, const std::string& name,
                        const std::vector<double>& coefficients) {
  const std::optional<Distortion> kind = distortion_of(name);
  if (!kind) {
    return fail(ErrorCode::kUnsupported,
                "distortion model " + name +
                    " is not supported; supported are none, radial-tangential "
                    "(radtan, plumb_bob) and equidistant (fisheye)");
  }
  camera.distortion = *kind;
  camera.coefficients = {};
  const std::size_t n = coefficients.size();
  const std::size_t most = *kind == Distortion::kNone          ? 0
                           : *kind == Distortion::kEquidistant ? 4
                                                               : 5;
  const std::size_t least = std::min<std::size_t>(most, 4);
  const auto beyond = coefficients.begin() + static_cast<std::ptrdiff_t>(std::min(n, most));
  if (!std::all_of(beyond, coefficients.end(), [](double k) { return k == 0; })) {
    return fail(ErrorCode::kUnsupported,
                "distortion model " + name + " has " + std::to_string(most) +
                    " coefficients here, the file has " + std::to_string(n) +
                    " (rational, thin prism and tilted lenses are not supported)");
  }
  if (n < least) {
    return fail(ErrorCode::kInvalid, "distortion model " + name + " needs " +
                                         std::to_string(least) + " coefficients, the file has " +
                                         std::to_string(n));
  }
  std::copy(coefficients.begin(), beyond, camera.coefficients.begin());
  return {};
}

std::string name_of(Distortion distortion) {
  switch (distortion) {
    case Distortion::kNone:
      return "none";
    case Distortion::kRadialTangential:
      return "radial-tangential";
    case Distortion::kEquidistant:
      return "equidistant";
  }
  return "none";
}

}  // namespace fiducap
