#include "capture/import/imu_csv.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "base/gravity.hpp"
#include "base/numeric.hpp"
#include "base/text.hpp"
#include "capture/import/message_log.hpp"
#include "capture/recording/csv_reader.hpp"
#include "capture/recording/recording_layout.hpp"

namespace fiducap {

std::size_t put_in_order(std::vector<VectorReading>& readings) {
  std::ranges::stable_sort(readings, {}, &VectorReading::stamp_ns);
  const auto same = [](const auto& a, const auto& b) { return a.stamp_ns == b.stamp_ns; };
  const auto repeated = std::unique(readings.begin(), readings.end(), same);
  const auto struck = static_cast<std::size_t>(readings.end() - repeated);
  readings.erase(repeated, readings.end());
  return struck;
}

ImuPairs pair_readings(const std::vector<VectorReading>& gyro,
                       const std::vector<VectorReading>& accel) {
  ImuPairs out;
  out.samples.reserve(gyro.size());
  ReadingPairs pairs;
  auto g = gyro.begin();
  auto a = accel.begin();
  while (g != gyro.end() || a != accel.end()) {
    if (a == accel.end() || (g != gyro.end() && g->stamp_ns <= a->stamp_ns))
      pairs.add_gyro(*g++);
    else
      pairs.add_accel(*a++);
    while (const auto pair = pairs.take())
      out.samples.push_back({instant_from_ns(pair->stamp_ns), pair->w, pair->f});
  }
  out.alone = gyro.size() - out.samples.size();
  return out;
}

namespace {

constexpr std::size_t kMostImuRows = 20'000'000;
constexpr std::size_t kRowsForGuess = 5000;

/// Numbers of a line; time as a double suffices to guess its unit.
struct RawRow {
  double time{};
  Eigen::Vector3d w;
  Eigen::Vector3d f;
};

bool parse_row(std::span<const std::string_view> fields, const ImuColumns& columns, RawRow& row) {
  if (fields.size() <= columns.last()) return false;
  std::int64_t ns = 0;
  if (parse_date(fields[columns.time], ns))
    row.time = static_cast<double>(ns);
  else if (!parse_number(fields[columns.time], row.time))
    return false;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!parse_number(fields[columns.gyro[i]], row.w[static_cast<Eigen::Index>(i)]) ||
        !parse_number(fields[columns.accel[i]], row.f[static_cast<Eigen::Index>(i)]))
      return false;
  }
  return std::isfinite(row.time) && row.w.allFinite() && row.f.allFinite();
}

double quantile_of(std::vector<double>& values, double share) {
  return nth_smallest(values,
                      static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

class ImuCsv final {
 public:
  ImuCsv(std::string path, const ImportOptions& options)
      : path_(std::move(path)), options_(options) {}

  Expected<ImuTable> read() {
    if (const auto found = find_columns(); !found) return tl::unexpected(found.error());
    if (const auto guessed = guess_units(); !guessed) return tl::unexpected(guessed.error());
    auto rows = CsvReader::open(path_, separator_);
    if (!rows) return tl::unexpected(rows.error());
    table_.found.kind = FoundKind::kImu;
    table_.found.name = std::filesystem::path(path_).filename().string();
    table_.found.type = "CSV";
    for (RawRow row; rows->next() && rows->line_is_complete();) {
      std::int64_t ns = 0;
      if (parse_row(rows->fields(), columns_, row) &&
          (parse_date(rows->fields()[columns_.time], ns) ||
           parse_time(rows->fields()[columns_.time], columns_.time_exponent, ns))) {
        if (table_.samples.size() == kMostImuRows)
          return fail(ErrorCode::kInvalid, "has more than 20 million lines", path_);
        add(ns, row);
      } else if (rows->line() > 1) {
        if (table_.found.unreadable++ == 0)
          table_.found.first_fault =
              "line " + std::to_string(rows->line()) + " lacks the seven numbers";
      }
    }
    return std::move(table_);
  }

 private:
  Expected<void> find_columns() {
    const auto line = first_line(path_);
    if (!line) return tl::unexpected(line.error());
    separator_ = separator_of(*line);
    std::vector<std::string> header = split_header(*line, separator_);
    double number = 0;
    if (header.size() >= 7 && parse_number(header[1], number)) {
      has_header_ = false;
      header = {"time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"};
      remark("has no header; its columns are assumed to be time, gyro x y z, accelerometer x y z");
    }
    auto columns =
        find_imu_columns(header, has_header_ ? options_.imu_columns : "", options_.imu_units);
    if (!columns) {
      Error error = columns.error();
      if (error.context.empty()) error.context = path_;
      return tl::unexpected(error);
    }
    columns_ = *columns;
    if (has_header_)
      remark("time is '" + printable_name(header[columns_.time]) + "', gyro '" +
             printable_name(header[columns_.gyro[0]]) + "' …, accelerometer '" +
             printable_name(header[columns_.accel[0]]) + "' …");
    return {};
  }

  Expected<void> guess_units() {
    auto rows = CsvReader::open(path_, separator_);
    if (!rows) return tl::unexpected(rows.error());
    std::vector<double> steps, rates, forces;
    double last = std::numeric_limits<double>::quiet_NaN();
    std::int64_t ns = 0;
    for (RawRow row; rates.size() < kRowsForGuess && rows->next();) {
      if (!parse_row(rows->fields(), columns_, row)) continue;
      if (parse_date(rows->fields()[columns_.time], ns)) columns_.time_exponent = 0;
      if (row.time > last) steps.push_back(row.time - last);
      last = row.time;
      rates.push_back(row.w.cwiseAbs().maxCoeff());
      forces.push_back(row.f.norm());
    }
    if (rates.size() < 2 || steps.empty())
      return fail(ErrorCode::kInvalid, "has no two lines of seven numbers whose time increases",
                  path_);
    guess_time(steps);
    guess_gyro(rates);
    guess_accel(forces);
    if (columns_.is_apple)
      remark("the accelerometer is that of SensorLog on iOS: its sign is inverted");
    return {};
  }

  void guess_time(std::vector<double>& steps) {
    const double step = quantile_of(steps, 0.5);
    const bool is_said = columns_.time_exponent != ImuColumns::kNotSaid;
    // Lists of seconds or microseconds below EuRoC's header, which says ns.
    constexpr double kShortest_ns = 1e4;
    if (is_said && (step * std::pow(10.0, columns_.time_exponent) > kShortest_ns ||
                    !options_.imu_units.empty()))
      return;
    // For rates of 2.5 to 2500 Hz.
    constexpr std::array<std::pair<double, int>, 3> kUpTo{{{0.4, 9}, {400, 6}, {400e3, 3}}};
    columns_.time_exponent = 0;
    for (auto limit = kUpTo.rbegin(); limit != kUpTo.rend(); ++limit)
      if (step <= limit->first) columns_.time_exponent = limit->second;
    constexpr std::array<const char*, 4> kNames{"ns", "µs", "ms", "s"};
    remark(std::string("time is assumed in ") +
           kNames[static_cast<std::size_t>(columns_.time_exponent / 3)] + " (median step " +
           shortest(step) + (is_said ? ", not as its header has it)" : ")"));
  }

  void guess_gyro(std::vector<double>& rates) {
    if (columns_.gyro_unit > 0) return;
    // Hand motion stays below 20 rad/s, but 1 % of the readings in degrees exceed it.
    constexpr double kFast = 20;
    const double fast = quantile_of(rates, 0.99);
    columns_.gyro_unit = fast > kFast ? kDegree : 1.0;
    remark(std::string("the gyro is assumed in ") + (fast > kFast ? "deg/s" : "rad/s") +
           " (99 % of its readings are below " + fixed(fast, 2) + ")");
  }

  void guess_accel(std::vector<double>& forces) {
    if (columns_.accel_unit > 0) return;
    const double median = quantile_of(forces, 0.5);
    const bool in_g = median > 0.5 && median < 2;
    const bool in_mg = median > 500 && median < 2000;
    columns_.accel_unit = in_g ? kStandardGravity_m_s2 : in_mg ? kStandardGravity_m_s2 / 1000 : 1.0;
    remark(std::string("the accelerometer is assumed in ") +
           (in_g    ? "g"
            : in_mg ? "mg"
                    : "m/s²") +
           " (median " + fixed(median, 2) + ")");
  }

  void add(std::int64_t ns, const RawRow& row) {
    FoundStream& found = table_.found;
    ++found.count;
    if (!table_.samples.empty() && ns <= found.last_ns) {
      ++found.backwards;
      return;
    }
    if (table_.samples.empty()) found.first_ns = ns;
    found.last_ns = ns;
    table_.samples.push_back({instant_from_ns(ns), row.w * columns_.gyro_unit,
                              row.f * (columns_.is_apple ? -1 : 1) * columns_.accel_unit});
  }

  void remark(const std::string& text) {
    table_.remarks.push_back(std::filesystem::path(path_).filename().string() + ": " + text);
  }

  std::string path_;
  const ImportOptions& options_;
  ImuColumns columns_;
  char separator_{','};
  bool has_header_{true};
  ImuTable table_;
};

}  // namespace

bool parse_time(std::string_view field, int exponent, std::int64_t& ns) {
  if (field.find_first_of("eE") != std::string_view::npos) {
    double value = 0;
    if (!parse_number(field, value)) return false;
    const double in_ns = value * std::pow(10.0, exponent);
    if (!(std::abs(in_ns) < 4e18)) return false;
    ns = static_cast<std::int64_t>(std::llround(in_ns));
    return true;
  }
  if (field.find_first_of("0123456789") == std::string_view::npos) return false;
  const std::size_t point = std::min(field.find('.'), field.size());
  std::string digits(field.substr(0, point));
  std::string_view behind = field.substr(std::min(point + 1, field.size()));
  behind = behind.substr(0, static_cast<std::size_t>(exponent));
  if (behind.find_first_not_of("0123456789") != std::string_view::npos) return false;
  digits += behind;
  digits.append(static_cast<std::size_t>(exponent) - behind.size(), '0');
  constexpr std::int64_t kFarthest = 4'000'000'000'000'000'000;
  return parse_number(digits, ns) && ns > -kFarthest && ns < kFarthest;
}

namespace {

/// At most `most` digits at the front, which are removed. @return −1: there is none
int take_digits(std::string_view& text, std::size_t most) {
  int value = -1;
  for (; most > 0 && !text.empty() && text[0] >= '0' && text[0] <= '9'; --most) {
    value = 10 * std::max(value, 0) + (text[0] - '0');
    text.remove_prefix(1);
  }
  return value;
}

bool take_one_of(std::string_view& text, std::string_view those) {
  if (text.empty() || those.find(text[0]) == std::string_view::npos) return false;
  text.remove_prefix(1);
  return true;
}

/// `10:00` or `1000`, in minutes. @return −1: there is none
int take_minutes(std::string_view& text) {
  const int hours = take_digits(text, 2);
  take_one_of(text, ":");
  const int minutes = take_digits(text, 2);
  return hours < 0 || hours > 23 || minutes < 0 || minutes > 59 ? -1 : hours * 60 + minutes;
}

/// Days since 1970 of `2026-11-29`. @return −1: there is none
std::int64_t take_day(std::string_view& text) {
  namespace chr = std::chrono;
  const int year = take_digits(text, 4);
  if (!take_one_of(text, "-/")) return -1;
  const int month = take_digits(text, 2);
  if (!take_one_of(text, "-/")) return -1;
  const int day = take_digits(text, 2);
  constexpr int kFirst = 1970, kLast = 2261;  // ns since 1970 fit 64 bits
  if (year < kFirst || year > kLast || month < 0 || day < 0 || !take_one_of(text, "T ")) return -1;
  const chr::year_month_day date{chr::year(year), chr::month(static_cast<unsigned>(month)),
                                 chr::day(static_cast<unsigned>(day))};
  return date.ok() ? chr::sys_days(date).time_since_epoch().count() : -1;
}

}  // namespace

bool parse_date(std::string_view text, std::int64_t& ns) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  std::string_view rest = text;
  const std::int64_t day = take_day(rest);
  if (day < 0) rest = text;  // a time of day
  if (rest.find(':') == std::string_view::npos) return false;
  const int minutes = take_minutes(rest);
  const int seconds = take_one_of(rest, ":") ? take_digits(rest, 2) : -1;
  if (minutes < 0 || seconds < 0 || seconds > 60) return false;
  ns = ((std::max<std::int64_t>(day, 0) * 24 * 60 + minutes) * 60 + seconds) * kSecond_ns;
  if (take_one_of(rest, ".,"))
    for (std::int64_t unit = kSecond_ns / 10; !rest.empty(); unit /= 10) {
      const int digit = take_digits(rest, 1);
      if (digit < 0) break;
      ns += digit * unit;
    }
  while (take_one_of(rest, " ")) continue;
  if (take_one_of(rest, "Zz") || rest.empty()) return rest.empty();
  const std::int64_t sign = rest.front() == '-' ? 1 : -1;
  if (!take_one_of(rest, "+-")) return false;
  const int zone = take_minutes(rest);
  ns += sign * zone * 60 * kSecond_ns;
  return zone >= 0 && rest.empty();
}

int stamp_exponent(std::string_view stamp) {
  const std::size_t digits = stamp.find('.');
  if (digits != std::string_view::npos || stamp.size() == 10) return 9;
  return stamp.size() == 13 ? 6 : stamp.size() == 16 ? 3 : 0;
}

Expected<std::string> first_line(const std::string& path) {
  if (!is_file(path)) return fail(ErrorCode::kNotFound, "no such file", path);
  std::ifstream file(path, std::ios::binary);
  constexpr std::size_t kLongest = 65536;
  std::string text(kLongest, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  const std::size_t begin = text.find_first_not_of("\r\n \t");
  if (begin == std::string::npos) return fail(ErrorCode::kInvalid, "is empty", path);
  return text.substr(begin, text.find('\n', begin) - begin);
}

Expected<ImuTable> read_imu_csv(const std::string& path, const ImportOptions& options) {
  return ImuCsv(path, options).read();
}

}  // namespace fiducap
