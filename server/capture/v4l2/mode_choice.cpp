#include "capture/v4l2/mode_choice.hpp"

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
constexpr int kMostMeasured = 3;  // what opens must not take many seconds
constexpr Duration kMeasuredSlice = std::chrono::milliseconds(100);

/// A format that gives the wished size, or says so.
struct Candidate {
  const PixelFormat* format{};
  double promised_hz{};  ///< Infinite: it does not say.
  double asked_hz{};     ///< 0: as it comes.
  std::optional<double> measured_hz{};
};

bool gives(const OfferedFormat& offered, PixelSize size) {
  if (offered.sizes.empty() || offered.any_size_between) return true;
  return std::any_of(offered.sizes.begin(), offered.sizes.end(),
                     [&](const OfferedSize& one) { return one.size == size; });
}

/// The lowest rate that is not lower than wished; else the highest. @param rates_hz  falling
double rate_to_ask(const std::vector<double>& rates_hz, double wished_hz) {
  if (rates_hz.empty()) return wished_hz;
  if (wished_hz <= 0) return rates_hz.front();
  double best = rates_hz.front();
  for (const double rate : rates_hz)
    if (rate >= wished_hz * 0.99) best = rate;
  return best;
}

std::string all_sizes(const std::vector<OfferedFormat>& offered) {
  std::vector<std::string> sizes;
  for (const OfferedFormat& format : offered) {
    for (const OfferedSize& one : format.sizes) {
      std::string text = size_text(one.size);
      if (std::find(sizes.begin(), sizes.end(), text) == sizes.end())
        sizes.push_back(std::move(text));
    }
  }
  std::string all;
  constexpr std::size_t kMostNamed = 24;
  for (std::size_t i = 0; i < std::min(sizes.size(), kMostNamed); ++i)
    all += (i == 0 ? "" : ", ") + sizes[i];
  return sizes.size() > kMostNamed ? all + ", …" : all;
}

std::string all_formats(const std::vector<OfferedFormat>& offered) {
  std::string all;
  for (const OfferedFormat& format : offered)
    all += (all.empty() ? "" : ", ") + code_text(format.code) + " (" + format.description + ")";
  return all.empty() ? "nothing" : all;
}

Error nothing_fits(const std::vector<OfferedFormat>& offered, const ModeWish& wish) {
  const bool some_readable =
      std::any_of(offered.begin(), offered.end(),
                  [](const OfferedFormat& format) { return pixel_format(format.code) != nullptr; });
  if (!some_readable) {
    return {ErrorCode::kUnsupported,
            "offers no format that is read here, but " + all_formats(offered) +
                ": cameras with raw Bayer images are opened as `libcamera:`",
            {}};
  }
  const std::string wished =
      wish.format == nullptr ? "images" : std::string(wish.format->name) + " images";
  return {ErrorCode::kInvalid,
          "gives no " + wished + " of " + size_text(wish.size) + "; it offers " +
              all_formats(offered) + " at " + all_sizes(offered),
          {}};
}

std::vector<Candidate> candidates_among(Port& port, const std::vector<OfferedFormat>& offered,
                                        const ModeWish& wish) {
  std::vector<Candidate> candidates;
  for (const OfferedFormat& format : offered) {
    const PixelFormat* known = pixel_format(format.code);
    if (known == nullptr || (wish.format != nullptr && known != wish.format)) continue;
    if (!gives(format, wish.size)) continue;
    const auto rates_hz = offered_rates(port, format.code, wish.size);
    Candidate candidate{known, std::numeric_limits<double>::infinity(),
                        rate_to_ask(rates_hz, wish.rate_hz)};
    if (!rates_hz.empty()) candidate.promised_hz = candidate.asked_hz;
    candidates.push_back(candidate);
  }
  // The quickest first; of those that promise the same, as the table of formats has them. 29.97 Hz
  // and 30 Hz are the same.
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    const double a_hz = std::round(a.promised_hz), b_hz = std::round(b.promised_hz);
    return a_hz != b_hz ? a_hz > b_hz : a.format < b.format;
  });
  return candidates;
}

/// @return 0 when not even a few images came
double measure_rate(Stream& stream, const Clock& clock) {
  constexpr int kFirst = 2;  // a device that wakes up
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
    } else if (one.promised_hz < std::numeric_limits<double>::infinity()) {
      text += " (promises " + fixed(one.promised_hz, 1) + " Hz)";
    }
  }
  return text;
}

/// Sets a mode and starts it.
class Trial final {
 public:
  Trial(Port& port, const Identity& identity, PixelSize size)
      : port_(port), identity_(identity), size_(size) {}

  [[nodiscard]] Expected<ChosenMode> start(const Candidate& candidate) const {
    ChosenMode chosen;
    chosen.format = candidate.format;
    auto mode = ask_for_mode(port_, identity_, candidate.format->code, size_, candidate.asked_hz);
    if (!mode) return tl::unexpected(mode.error());
    chosen.mode = *mode;
    if (mode->code != candidate.format->code || mode->size != size_) {
      return fail(ErrorCode::kInvalid, "was asked for " + std::string(candidate.format->name) +
                                           " at " + size_text(size_) + " and made it " +
                                           code_text(mode->code) + " at " + size_text(mode->size));
    }
    auto stream = Stream::start(port_, identity_);
    if (!stream) return tl::unexpected(stream.error());
    chosen.stream = std::move(*stream);
    return chosen;
  }

 private:
  Port& port_;
  const Identity& identity_;
  PixelSize size_;
};

Error gives_no_image() {
  return {ErrorCode::kUnavailable,
          "gives no images in " + fixed(to_seconds(kLongestMeasured), 1) +
              " s: is its lens cap a switch, does it wait for a trigger (`trigger: on`), is its "
              "USB bus full?",
          {}};
}

/// @return the quickest of all, streaming
Expected<ChosenMode> quickest(std::vector<Candidate>& candidates, const Trial& trial,
                              bool is_measured, const Clock& clock) {
  std::optional<ChosenMode> best;
  const Candidate* best_candidate = nullptr;
  Error failure = gives_no_image();
  int measured = 0;
  for (Candidate& candidate : candidates) {
    if (best && (!is_measured || best->measured_hz >= kSameRate * candidate.promised_hz)) break;
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

Expected<ChosenMode> choose_mode(Port& port, const Identity& identity, const ModeWish& asked,
                                 const Clock& clock) {
  ModeWish wish = asked;
  if (wish.size.width == 0) {
    if (const auto now = current_mode(port, identity)) wish.size = now->size;
  }
  const auto offered = offered_formats(port, identity);
  std::vector<Candidate> candidates = candidates_among(port, offered, wish);
  if (candidates.empty()) return tl::unexpected(nothing_fits(offered, wish));
  const Trial trial(port, identity, wish.size);
  auto best = quickest(candidates, trial, !wish.waits_for_trigger, clock);
  if (best) best->others = others_text(candidates, best->format);
  return best;
}

}  // namespace fiducap::v4l2
