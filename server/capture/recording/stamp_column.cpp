#include "capture/recording/stamp_column.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"
#include "capture/recording/csv_reader.hpp"

namespace fiducap {
namespace {

constexpr std::int64_t kHour_ns = 3'600'000'000'000;
// Longer than the longest recording, shorter than memory.
constexpr std::size_t kMostStamps = 20'000'000;
constexpr std::size_t kStepsForMedian = 2000;

/// The longest subsequence in which time never goes back, as indices; of equally long ones that of
/// earlier lines. Patience sorting from the end of the file: of all subsequences of a length only
/// the one that begins latest can become the longest.
template <typename Stamp>
std::vector<std::uint32_t> longest_in_order(const std::vector<Stamp>& stamps) {
  constexpr std::uint32_t kNone = 0xffffffff;
  std::vector<std::uint32_t> begins;  // by length: where the best subsequence begins
  std::vector<std::uint32_t> after(stamps.size(), kNone);
  for (auto i = static_cast<std::uint32_t>(stamps.size()); i-- > 0;) {
    const auto place = std::upper_bound(
        begins.begin(), begins.end(), stamps[i].ns,
        [&](std::int64_t ns, std::uint32_t begin) { return ns > stamps[begin].ns; });
    if (place != begins.begin()) after[i] = *(place - 1);
    if (place == begins.end())
      begins.push_back(i);
    else
      *place = i;
  }
  std::vector<std::uint32_t> chain;
  for (std::uint32_t i = begins.empty() ? kNone : begins.back(); i != kNone; i = after[i])
    chain.push_back(i);
  return chain;
}

/// From and to of the largest group of stamps without a gap of more than an hour; of two the
/// earlier one.
std::pair<std::int64_t, std::int64_t> largest_group(std::vector<std::int64_t> ns) {
  std::sort(ns.begin(), ns.end());
  std::pair<std::size_t, std::size_t> best{0, 0};
  for (std::size_t begin = 0, end = 0; begin < ns.size(); begin = end) {
    for (end = begin + 1; end < ns.size(); ++end)
      if (ns[end] - ns[end - 1] > kHour_ns) break;
    if (end - begin > best.second - best.first) best = {begin, end};
  }
  return {ns[best.first], ns[best.second - 1]};
}

}  // namespace

Expected<StampColumn> StampColumn::read(const std::filesystem::path& path) {
  StampColumn column(path.string());
  const Expected<bool> in_order = column.is_in_order();
  if (!in_order) return tl::unexpected(in_order.error());
  if (*in_order) return column;
  const auto all = column.read_all();
  if (!all) return tl::unexpected(all.error());
  column.keep_majority(*all);
  return column;
}

/// Once through the file, keeping nothing but what is told about it.
Expected<bool> StampColumn::is_in_order() {
  Expected<CsvReader> rows = CsvReader::open(path_);
  if (!rows) return tl::unexpected(rows.error());
  std::vector<std::int64_t> steps;
  std::int64_t last = 0;
  bool in_order = true;
  while (rows->next() && rows->line_is_complete()) {
    std::int64_t ns = 0;
    if (!parse_stamp(rows->fields()[0], ns)) {
      if (unreadable_++ == 0 || rows->line() == 2) first_unreadable_ = rows->fields()[0];
      continue;
    }
    if (stamps_++ == 0) first_ = instant_from_ns(ns);
    if (stamps_ > 1 && (ns < last || ns - last > kHour_ns)) in_order = false;
    if (stamps_ > 1 && ns > last && steps.size() < kStepsForMedian) steps.push_back(ns - last);
    last = ns;
  }
  last_ = instant_from_ns(last);
  if (!steps.empty()) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    step_ = Duration(*middle);
  }
  return in_order;
}

Expected<std::vector<StampColumn::Stamp>> StampColumn::read_all() const {
  Expected<CsvReader> rows = CsvReader::open(path_);
  if (!rows) return tl::unexpected(rows.error());
  if (stamps_ > kMostStamps)
    return fail(ErrorCode::kInvalid,
                "its stamps are not in order, and it has more than 20 million lines: sort it, or "
                "cut it into parts",
                path_);
  std::vector<Stamp> all;
  all.reserve(stamps_);
  while (rows->next() && rows->line_is_complete()) {
    Stamp stamp{0, rows->line()};
    if (parse_stamp(rows->fields()[0], stamp.ns)) all.push_back(stamp);
  }
  return all;
}

void StampColumn::keep_majority(const std::vector<Stamp>& all) {
  if (all.empty()) return;  // the file has changed under us
  std::vector<std::int64_t> ns;
  ns.reserve(all.size());
  for (const Stamp& stamp : all) ns.push_back(stamp.ns);
  const auto [from, to] = largest_group(std::move(ns));
  std::vector<Stamp> near;
  for (const Stamp& stamp : all)
    if (stamp.ns >= from && stamp.ns <= to) near.push_back(stamp);
  const std::vector<std::uint32_t> kept = longest_in_order(near);
  auto next = kept.begin();
  for (const Stamp& stamp : all) {
    if (next != kept.end() && near[*next].line == stamp.line)
      ++next;
    else
      left_out_.push_back(stamp.line);
  }
  first_ = instant_from_ns(near[kept.front()].ns);
  last_ = instant_from_ns(near[kept.back()].ns);
}

bool StampColumn::accepts(std::uint64_t line) {
  while (next_left_out_ < left_out_.size() && left_out_[next_left_out_] < line) ++next_left_out_;
  return next_left_out_ == left_out_.size() || left_out_[next_left_out_] != line;
}

void StampColumn::log_left_out() const {
  if (left_out_.empty()) return;
  log::warning("capture", path_ + ": stamps of " + std::to_string(left_out_.size()) + " of " +
                              std::to_string(stamps_) +
                              " lines are out of order or far from the others: left out (first in "
                              "line " +
                              std::to_string(left_out_.front()) + ")");
}

}  // namespace fiducap
