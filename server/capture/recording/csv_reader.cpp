#include "capture/recording/csv_reader.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "base/log.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kBufferSize = 1 << 16;
constexpr std::string_view kBlanks = " \t";
constexpr std::string_view kAroundFields = " \t\r\"";

std::string_view trimmed(std::string_view text, std::string_view around) {
  const std::size_t first = text.find_first_not_of(around);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(around) - first + 1);
}

constexpr std::int64_t kHour_ns = 3'600'000'000'000;
// More than the longest recording has, and less than memory.
constexpr std::size_t kMostStamps = 20'000'000;
constexpr std::size_t kStepsForMedian = 2000;

/// The longest non-decreasing subsequence, as indices; of equal ones that of earlier lines. From
/// the end: of all of one length only the one that begins latest can become the longest.
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

/// First and last of the largest (of equal ones: first) group of stamps without a gap of an hour.
std::pair<std::int64_t, std::int64_t> largest_group(std::vector<std::int64_t> ns) {
  std::ranges::sort(ns);
  std::pair<std::size_t, std::size_t> best{0, 0};
  for (std::size_t begin = 0, end = 0; begin < ns.size(); begin = end) {
    for (end = begin + 1; end < ns.size(); ++end)
      if (ns[end] - ns[end - 1] > kHour_ns) break;
    if (end - begin > best.second - best.first) best = {begin, end};
  }
  return {ns[best.first], ns[best.second - 1]};
}

}  // namespace

Expected<CsvReader> CsvReader::open(const std::filesystem::path& path, char separator) {
  CsvReader reader(path.string());
  reader.separator_ = separator;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    return fail(ErrorCode::kNotFound, "no such file", path.string());
  reader.file_.open(path, std::ios::binary);
  if (!reader.file_)
    return fail(ErrorCode::kUnavailable, "cannot be opened for reading", path.string());
  return reader;
}

CsvReader::CsvReader(std::string path) : path_(std::move(path)), buffer_(kBufferSize) {
  fields_.reserve(32);
}

// Moves the rest to the front and reads more. @return false at the end of the file.
bool CsvReader::fill() {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  if (!file_.good()) return false;
  file_.read(buffer_.data() + end_, static_cast<std::streamsize>(buffer_.size() - end_));
  const auto got = static_cast<std::size_t>(file_.gcount());
  end_ += got;
  return got > 0;
}

bool CsvReader::take_line(std::string_view& line) {
  bool too_long = false;
  for (;;) {
    const char* from = buffer_.data() + begin_;
    const char* newline = static_cast<const char*>(std::memchr(from, '\n', end_ - begin_));
    if (newline == nullptr) {
      if (end_ - begin_ == buffer_.size()) {
        too_long = true;
        begin_ = end_;
      }
      if (fill()) continue;
      if (begin_ == end_) {
        if (too_long) count_damaged();
        return false;
      }
      newline = buffer_.data() + end_;
      from = buffer_.data();
      complete_ = false;
    }
    ++line_;
    line = std::string_view(from, static_cast<std::size_t>(newline - from));
    begin_ = std::min(end_, begin_ + line.size() + 1);
    if (!too_long) return true;
    count_damaged();
    too_long = false;
    if (!complete_) return false;
  }
}

bool CsvReader::next() {
  constexpr std::size_t kMaxFields = 64;
  fields_.clear();
  for (std::string_view line; take_line(line);) {
    line = trimmed(line, separator_ == '\t' ? " \r" : " \t\r");
    if (line.empty() || line.front() == '#') continue;
    if (separator_ != ',') {
      char* const begin = buffer_.data() + (line.data() - buffer_.data());
      std::replace(begin, begin + line.size(), ',', '.');
    }
    for (bool more = true; more && fields_.size() < kMaxFields;) {
      std::size_t end = line.find(separator_);
      if (separator_ == ' ') end = line.find_first_of(kBlanks);
      fields_.push_back(trimmed(line.substr(0, end), kAroundFields));
      more = end != std::string_view::npos;
      if (more) line.remove_prefix(end + 1);
      if (separator_ == ' ') line = trimmed(line, kBlanks);
    }
    return true;
  }
  return false;
}

void CsvReader::log_damage() const {
  if (damaged_ == 0) return;
  log::warning("capture", path_ + ": " + std::to_string(damaged_) +
                              " damaged lines left out, the first is line " +
                              std::to_string(first_damaged_line_));
}

bool parse(std::span<const std::string_view> fields, std::span<double> out) {
  if (fields.size() < out.size()) return false;
  for (std::size_t i = 0; i < out.size(); ++i)
    if (!parse_number(fields[i], out[i])) return false;
  return true;
}

bool parse_stamp(std::string_view field, std::int64_t& ns) {
  constexpr std::int64_t kLast = 4'000'000'000'000'000'000;  // the year 2096; leaves room for sums
  return parse_number(field, ns) && ns >= 0 && ns <= kLast;
}

Expected<StampColumn> StampColumn::read(const std::filesystem::path& path) {
  StampColumn column(path.string());
  const Expected<bool> in_order = column.is_in_order();
  if (!in_order) return tl::unexpected(in_order.error());
  if (*in_order) return column;
  return column.keep_majority().map([&] { return std::move(column); });
}

/// First pass, without memory: counts, first and last stamp, median step.
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

/// Second pass.
Expected<void> StampColumn::keep_majority() {
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
  if (all.empty()) return {};  // the file has changed meanwhile
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
  return {};
}

void StampColumn::log_left_out() const {
  if (left_out_.empty()) return;
  log::warning("capture",
               path_ + ": stamps of " + std::to_string(left_out_.size()) + " of " +
                   std::to_string(stamps_) +
                   " lines are out of order or far from the others: left out (first in line " +
                   std::to_string(left_out_.front()) + ")");
}

Expected<StampedRows> StampedRows::open(const std::filesystem::path& path) {
  Expected<CsvReader> rows = CsvReader::open(path);
  if (!rows) return tl::unexpected(rows.error());
  Expected<StampColumn> stamps = StampColumn::read(path);
  if (!stamps) return tl::unexpected(stamps.error());
  return StampedRows(std::move(*rows), std::move(*stamps));
}

bool StampedRows::next(std::int64_t& ns) {
  while (rows_.next()) {
    if (!rows_.line_is_complete()) return false;
    if (!parse_stamp(rows_.fields()[0], ns)) {
      rows_.count_damaged();
    } else if (stamps_.accepts(rows_.line())) {
      return true;
    }
  }
  return false;
}

}  // namespace fiducap
