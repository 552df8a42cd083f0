#include "capture/v4l2/stream.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "base/text.hpp"

namespace fiducap::v4l2 {
namespace {

constexpr double kSameRate = 0.97;  // of two rates: crystals and rounding differ by less
constexpr Duration kMeasured = std::chrono::milliseconds(500);
constexpr Duration kLongestMeasured = std::chrono::milliseconds(2500);
constexpr int kMostMeasured = 3;  // to open within a few seconds
constexpr Duration kMeasuredSlice = std::chrono::milliseconds(100);

/// A format that offers the requested size.
struct Candidate {
  const PixelFormat* format{};
  double nominal_hz{};    ///< Infinite: not known.
  double requested_hz{};  ///< 0: not changed.
  std::optional<double> measured_hz{};
};

bool gives(const OfferedFormat& offered, PixelSize size) {
  if (offered.sizes.empty() || offered.any_size_between) return true;
  return std::ranges::find(offered.sizes, size, &OfferedSize::size) != offered.sizes.end();
}

/// The lowest rate not below the wanted one; else the highest. @param rates_hz  falling
double rate_to_ask(const std::vector<double>& rates_hz, double wanted_hz) {
  if (rates_hz.empty()) return wanted_hz;
  if (wanted_hz <= 0) return rates_hz.front();
  double best = rates_hz.front();
  for (const double rate : rates_hz)
    if (rate >= wanted_hz * 0.99) best = rate;
  return best;
}

std::string all_sizes(const std::vector<OfferedFormat>& offered) {
  std::vector<std::string> sizes;
  for (const OfferedFormat& format : offered) {
    for (const OfferedSize& one : format.sizes) {
      std::string text = size_text(one.size);
      if (std::ranges::find(sizes, text) == sizes.end()) sizes.push_back(std::move(text));
    }
  }
  constexpr std::size_t kMostNamed = 24;
  return comma_list(std::span(sizes).first(std::min(sizes.size(), kMostNamed))) +
         (sizes.size() > kMostNamed ? ", …" : "");
}

std::string all_formats(const std::vector<OfferedFormat>& offered) {
  if (offered.empty()) return "nothing";
  return comma_list(offered, [](const OfferedFormat& format) {
    return code_text(format.code) + " (" + format.description + ")";
  });
}

Error nothing_fits(const std::vector<OfferedFormat>& offered, const ModeRequest& request) {
  const bool some_readable = std::ranges::any_of(
      offered, [](const OfferedFormat& format) { return pixel_format(format.code) != nullptr; });
  if (!some_readable)
    return {ErrorCode::kUnsupported,
            "offers no supported format, but " + all_formats(offered) +
                ": open cameras with raw Bayer images as `libcamera:`",
            {}};
  const std::string wanted =
      request.format == nullptr ? "images" : std::string(request.format->name) + " images";
  return {ErrorCode::kInvalid,
          "gives no " + wanted + " of " + size_text(request.size) + "; it offers " +
              all_formats(offered) + " at " + all_sizes(offered),
          {}};
}

std::vector<Candidate> candidates_among(Port& port, const std::vector<OfferedFormat>& offered,
                                        const ModeRequest& request) {
  std::vector<Candidate> candidates;
  for (const OfferedFormat& format : offered) {
    const PixelFormat* known = pixel_format(format.code);
    if (known == nullptr || (request.format != nullptr && known != request.format)) continue;
    if (!gives(format, request.size)) continue;
    const auto rates_hz = offered_rates(port, format.code, request.size);
    Candidate candidate{known, std::numeric_limits<double>::infinity(),
                        rate_to_ask(rates_hz, request.rate_hz)};
    if (!rates_hz.empty()) candidate.nominal_hz = candidate.requested_hz;
    candidates.push_back(candidate);
  }
  // By falling rate, then in the order of pixel_formats(). 29.97 Hz and 30 Hz are equal.
  std::ranges::sort(candidates, [](const Candidate& a, const Candidate& b) {
    const double a_hz = std::round(a.nominal_hz), b_hz = std::round(b.nominal_hz);
    return a_hz != b_hz ? a_hz > b_hz : a.format < b.format;
  });
  return candidates;
}

/// @return 0 with too few images
double measure_rate(Stream& stream, const Clock& clock) {
  constexpr int kFirst = 2;  // images of a starting device
  constexpr int kLeast = 4;
  const Instant began = clock.now();
  Instant first{}, last{};
  int images = -kFirst;
  while (clock.now() - began < kLongestMeasured) {
    const auto taken = stream.take(kMeasuredSlice);
    if (!taken) return 0;
    if (!*taken) continue;
    const bool counts = !(*taken)->damaged;
    const KernelStamp stamp = (*taken)->stamp;
    stream.give_back(**taken);
    if (!counts || ++images < 1) continue;
    last = stamp.is_monotonic ? instant_from_ns(stamp.ns) : clock.now();
    if (images == 1) first = last;
    if (images >= kLeast && last - first >= kMeasured) break;
  }
  return images >= 2 && last > first ? (images - 1) / to_seconds(last - first) : 0;
}

std::string others_text(const std::vector<Candidate>& candidates, const PixelFormat* chosen) {
  std::string text;
  for (const Candidate& one : candidates) {
    if (one.format == chosen) continue;
    text += (text.empty() ? "" : ", ") + std::string(one.format->name);
    if (one.measured_hz) {
      text += " (" + fixed(*one.measured_hz, 1) + " Hz measured)";
    } else if (one.nominal_hz < std::numeric_limits<double>::infinity()) {
      text += " (" + fixed(one.nominal_hz, 1) + " Hz nominal)";
    }
  }
  return text;
}

struct Trial {
  Port& port;
  const Identity& identity;
  PixelSize size;

  [[nodiscard]] Expected<ChosenMode> start(const Candidate& candidate) const {
    ChosenMode chosen;
    chosen.format = candidate.format;
    auto mode = request_mode(port, identity, candidate.format->code, size, candidate.requested_hz);
    if (!mode) return tl::unexpected(mode.error());
    chosen.mode = *mode;
    if (mode->code != candidate.format->code || mode->size != size)
      return fail(ErrorCode::kInvalid, "was set to " + std::string(candidate.format->name) +
                                           " at " + size_text(size) + " but uses " +
                                           code_text(mode->code) + " at " + size_text(mode->size));
    auto stream = Stream::start(port, identity);
    if (!stream) return tl::unexpected(stream.error());
    chosen.stream = std::move(*stream);
    return chosen;
  }
};

/// @return the fastest, streaming
Expected<ChosenMode> fastest(std::vector<Candidate>& candidates, const Trial& trial,
                             bool is_measured, const Clock& clock) {
  std::optional<ChosenMode> best;
  const Candidate* best_candidate = nullptr;
  Error failure{ErrorCode::kUnavailable,
                "gives no images in " + fixed(to_seconds(kLongestMeasured), 1) +
                    " s: is its lens cap a switch, does it wait for a trigger (`trigger: on`), is "
                    "its USB bus full?",
                {}};
  int measured = 0;
  for (Candidate& candidate : candidates) {
    if (best && (!is_measured || best->measured_hz >= kSameRate * candidate.nominal_hz)) break;
    if (measured == kMostMeasured) break;
    if (best) best->stream.reset();  // a device has one stream at a time
    auto started = trial.start(candidate);
    if (!started) {
      failure = started.error();
      continue;
    }
    if (is_measured) {
      ++measured;
      started->measured_hz = measure_rate(*started->stream, clock);
      candidate.measured_hz = started->measured_hz;
      if (started->measured_hz == 0) continue;
    }
    if (best && best->measured_hz >= kSameRate * started->measured_hz) continue;
    best = std::move(*started);
    best_candidate = &candidate;
  }
  if (!best) return tl::unexpected(failure);
  if (best->stream) return std::move(*best);
  auto again = trial.start(*best_candidate);
  if (again) again->measured_hz = best->measured_hz;
  return again;
}

}  // namespace

Expected<ChosenMode> choose_mode(Port& port, const Identity& identity, const ModeRequest& requested,
                                 const Clock& clock) {
  ModeRequest request = requested;
  if (request.size.width == 0) {
    if (const auto now = current_mode(port, identity)) request.size = now->size;
  }
  const auto offered = offered_formats(port, identity);
  std::vector<Candidate> candidates = candidates_among(port, offered, request);
  if (candidates.empty()) return tl::unexpected(nothing_fits(offered, request));
  const Trial trial{port, identity, request.size};
  auto best = fastest(candidates, trial, !request.waits_for_trigger, clock);
  if (best) best->others = others_text(candidates, best->format);
  return best;
}

}  // namespace fiducap::v4l2
