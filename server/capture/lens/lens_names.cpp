#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include "capture/lens/camera_model.hpp"

namespace fiducap {
namespace {

/// What the coefficients of a name mean. In lower case, with hyphens.
constexpr std::array<std::pair<std::string_view, Distortion>, 20> kNames{
    {{"none", Distortion::kNone},
     {"pinhole", Distortion::kNone},
     {"radial-tangential", Distortion::kRadialTangential},
     {"radtan", Distortion::kRadialTangential},
     {"plumb-bob", Distortion::kRadialTangential},
     {"brown-conrady", Distortion::kRadialTangential},
     {"rectilinear", Distortion::kRadialTangential},  // calibdb
     {"opencv", Distortion::kRadialTangential},
     {"opencv4", Distortion::kRadialTangential},
     {"opencv5", Distortion::kRadialTangential},
     {"rational-polynomial", Distortion::kRational},
     {"rational", Distortion::kRational},
     {"opencv8", Distortion::kRational},
     {"full-opencv", Distortion::kRational},
     {"equidistant", Distortion::kEquidistant},
     {"equi", Distortion::kEquidistant},
     {"fisheye", Distortion::kEquidistant},
     {"opencv-fisheye", Distortion::kEquidistant},
     {"kannala-brandt4", Distortion::kEquidistant},
     {"kb4", Distortion::kEquidistant}}};

/// Lenses of other programs whose numbers mean something else, with zeros as well.
constexpr std::array<std::string_view, 10> kOthers{"omni",     "mei",       "ds",   "double-sphere",
                                                   "eucm",     "fov",       "atan", "unified",
                                                   "division", "scaramuzza"};

std::string plain_name(const std::string& name) {
  std::string out;
  for (const char c : name.substr(0, 32)) {
    const bool is_text = c >= ' ' && c <= '~';
    out += c == '_' || c == ' ' ? '-' : is_text ? static_cast<char>(std::tolower(c)) : '.';
  }
  return out;
}

tl::unexpected<Error> other_lens(const std::string& name) {
  return fail(
      ErrorCode::kUnsupported,
      "lens model " + name +
          " is not supported; supported are none, radial-tangential (radtan, plumb_bob), "
          "rational_polynomial and equidistant (fisheye, kb4): calibrate with one of these, "
          "in Kalibr pinhole-radtan or pinhole-equi, or with `fiducap calibrate camera`");
}

bool are_zero(std::span<const double> numbers) {
  return std::ranges::all_of(numbers, [](double k) { return k == 0; });
}

}  // namespace

Expected<void> set_lens(CameraModel& camera, const std::string& name,
                        std::span<const double> coefficients) {
  const std::string plain = plain_name(name);
  const auto* known =
      std::ranges::find_if(kNames, [&](const auto& entry) { return entry.first == plain; });
  if (std::ranges::find(kOthers, plain) != kOthers.end()) return other_lens(plain);
  const std::size_t n = coefficients.size();
  Distortion kind = Distortion::kNone;
  if (known != kNames.end()) {
    kind = known->second;
  } else if (!are_zero(coefficients)) {
    if (!plain.empty()) return other_lens(plain);
    if (n <= 4)
      return fail(ErrorCode::kInvalid,
                  "has " + std::to_string(n) +
                      " numbers without a distortion_model: add distortion_model: plumb_bob or "
                      "equidistant");
    kind = Distortion::kRational;
  }
  // OpenCV's lists of 4, 5 and 8 numbers are the same lens; the shortest is taken.
  constexpr std::size_t kPlain = coefficients_of(Distortion::kRadialTangential);
  if (kind == Distortion::kRadialTangential || kind == Distortion::kRational)
    kind = n > kPlain && !are_zero(coefficients.subspan(kPlain)) ? Distortion::kRational
                                                                 : Distortion::kRadialTangential;
  const std::size_t most = coefficients_of(kind);
  const std::size_t least = std::min<std::size_t>(most, 4);
  if (n < least || (kind == Distortion::kRational && n < most))
    return fail(ErrorCode::kInvalid, "lens model " + plain + " needs " + std::to_string(least) +
                                         (kind == Distortion::kEquidistant ? "" : ", 5 or 8") +
                                         " coefficients, there are " + std::to_string(n));
  const auto used = coefficients.first(std::min(n, most));
  if (!are_zero(coefficients.subspan(used.size())))
    return fail(ErrorCode::kUnsupported,
                "has " + std::to_string(n) + " coefficients of lens model " +
                    (plain.empty() ? std::string("OpenCV") : plain) + ", of which those after " +
                    std::to_string(most) +
                    " (thin prism, tilt) must be zero here: calibrate without them, or with "
                    "`fiducap calibrate camera`");
  camera.distortion = kind;
  camera.coefficients = {};
  std::ranges::copy(used, camera.coefficients.begin());
  return {};
}

std::string name_of(Distortion distortion) {
  constexpr std::array<const char*, 4> kWritten{"none", "radial-tangential", "equidistant",
                                                "rational_polynomial"};
  return kWritten[static_cast<std::size_t>(distortion)];
}

}  // namespace fiducap
