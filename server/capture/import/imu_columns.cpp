#include "capture/import/imu_csv.hpp"

#include <algorithm>
#include <cctype>
#include <optional>

#include "base/gravity.hpp"
#include "base/numeric.hpp"
#include "base/text.hpp"
#include "capture/import/message_log.hpp"

namespace fiducap {
namespace {

constexpr std::size_t kMostHeaderColumns = 64;  // as CsvReader has

enum class ColumnKind { kTime, kGyro, kAccel, kNone };

struct ColumnName {
  std::vector<std::string> words;  ///< Lower case, without axis and unit.
  int axis{-1};
  std::string unit;  ///< Text in brackets, lower case.

  [[nodiscard]] bool has(std::string_view word) const {
    return std::ranges::find(words, word) != words.end();
  }
  [[nodiscard]] bool mentions(std::string_view part) const {
    return std::ranges::any_of(
        words, [part](const std::string& word) { return word.find(part) != std::string::npos; });
  }
};

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }
bool is_letter(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0; }
bool is_upper(char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; }

/// `angularVelocity.x` → angular velocity x.
std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  std::string word;
  char before = ' ';
  for (const char c : text) {
    const bool begins = is_upper(c) && !is_upper(before);
    if ((begins || !is_letter(c)) && !word.empty()) words.push_back(std::exchange(word, {}));
    if (is_letter(c)) word += lower(c);
    before = c;
  }
  if (!word.empty()) words.push_back(word);
  return words;
}

/// `x` or the x of `gx`, `gyrox`. @return −1: none
int take_axis(std::vector<std::string>& words) {
  for (std::size_t i = words.size(); i-- > 0;) {
    const std::string& word = words[i];
    const bool is_letter_of_axis = word.size() == 1 && word[0] >= 'x' && word[0] <= 'z';
    const bool is_number_of_axis = word.size() == 1 && word[0] >= '0' && word[0] <= '3';
    if (!is_letter_of_axis && !is_number_of_axis) continue;
    const int axis = word[0] - (is_letter_of_axis ? 'x' : '0');
    words.erase(words.begin() + static_cast<std::ptrdiff_t>(i));
    return axis;
  }
  constexpr std::array<std::string_view, 11> kBefore{
      "g", "a", "w", "gyr", "gyro", "gyroscope", "acc", "accel", "accelerometer", "omega", "alpha"};
  for (std::string& word : words) {
    const char last = word.back();
    if (last < 'x' || last > 'z') continue;
    const std::string_view rest(word.data(), word.size() - 1);
    if (std::find(kBefore.begin(), kBefore.end(), rest) == kBefore.end()) continue;
    word.pop_back();
    return last - 'x';
  }
  return -1;
}

/// The last text in brackets is the unit; a single digit is an axis, as in PX4's `gyro_rad[0]`.
ColumnName column_name(std::string_view text) {
  ColumnName name;
  std::string plain;
  int axis_in_brackets = -1;
  while (!text.empty()) {
    const std::string_view before = text.substr(0, text.find_first_of("[("));
    plain += std::string(before) + ' ';
    text.remove_prefix(std::min(before.size() + 1, text.size()));
    if (text.empty()) break;
    const std::string_view inside = text.substr(0, text.find_first_of("])"));
    text.remove_prefix(std::min(inside.size() + 1, text.size()));
    if (inside.size() == 1 && inside >= "0" && inside <= "3") {
      axis_in_brackets = inside.front() - '0';
      continue;
    }
    name.unit.clear();
    for (const char c : inside)
      if (c != ' ') name.unit += lower(c);
  }
  name.words = words_of(plain);
  name.axis = take_axis(name.words);
  if (name.axis < 0) name.axis = axis_in_brackets;
  return name;
}

ColumnKind kind_of(const ColumnName& name) {
  for (const char* not_it : {"user", "gravity", "mag", "cov", "orient", "quat", "bias", "temp"})
    if (name.mentions(not_it)) return ColumnKind::kNone;
  if (name.axis >= 0) {
    if (name.mentions("acc") || name.has("a") || name.has("alpha")) return ColumnKind::kAccel;
    for (const char* word : {"gyr", "omega", "angular", "rotation", "rate"})
      if (name.mentions(word)) return ColumnKind::kGyro;
    if (name.has("w") || name.has("g")) return ColumnKind::kGyro;
    return ColumnKind::kNone;
  }
  const bool is_time = name.mentions("time") || name.mentions("stamp") || name.has("date") ||
                       name.has("t") || name.mentions("second");
  return is_time ? ColumnKind::kTime : ColumnKind::kNone;
}

int time_exponent_of(const std::string& unit) {
  if (unit == "s" || unit == "sec" || unit == "secs" || unit == "second" || unit == "seconds")
    return 9;
  if (unit == "ms" || unit == "msec" || unit == "milliseconds" || unit == "millis") return 6;
  if (unit == "us" || unit == "usec" || unit == "µs" || unit == "microseconds" || unit == "micros")
    return 3;
  if (unit == "ns" || unit == "nsec" || unit == "nanoseconds" || unit == "nanos") return 0;
  return ImuColumns::kNotSaid;
}

double gyro_unit_of(const std::string& unit) {
  if (unit.starts_with("mdps") || unit.starts_with("mdeg")) return kDegree / 1000;
  if (unit.find("deg") != std::string::npos || unit.find("dps") != std::string::npos ||
      unit.find("°") != std::string::npos)
    return kDegree;
  if (unit.starts_with("mrad")) return 1e-3;
  return unit.find("rad") != std::string::npos ? 1.0 : 0.0;
}

double accel_unit_of(const std::string& unit) {
  if (unit == "g" || unit == "gs") return kStandardGravity_m_s2;
  if (unit == "mg") return kStandardGravity_m_s2 / 1000;
  if (unit.starts_with("m/s") || unit.starts_with("ms") || unit.starts_with("m*s") ||
      unit.starts_with("m·s"))
    return 1.0;
  return 0.0;
}

/// Unit in brackets, else in the last words of the name.
template <typename Value>
Value unit_of(const ColumnName& name, Value silent, Value (*meaning)(const std::string&)) {
  if (!name.unit.empty()) return meaning(name.unit);
  for (auto word = name.words.rbegin(); word != name.words.rend(); ++word)
    if (const Value value = meaning(*word); value != silent) return value;
  return silent;
}

/// @param at  time, gyro x y z, accelerometer x y z
ImuColumns columns_at(const std::array<std::size_t, 7>& at) {
  ImuColumns columns;
  columns.time = at[0];
  std::copy_n(at.begin() + 1, 3, columns.gyro.begin());
  std::copy_n(at.begin() + 4, 3, columns.accel.begin());
  return columns;
}

Expected<ImuColumns> columns_by_name(const std::vector<std::string>& header,
                                     const std::string& names) {
  const std::vector<std::string> wanted = split_header(names);
  if (wanted.size() != 7)
    return fail(ErrorCode::kInvalid,
                "must be seven columns, separated by commas: time, gyro x y z, accelerometer x y "
                "z; there are " +
                    std::to_string(wanted.size()),
                "--imu-columns");
  std::array<std::size_t, 7> at{};
  for (std::size_t i = 0; i < 7; ++i) {
    const auto found = std::find(header.begin(), header.end(), wanted[i]);
    if (found == header.end())
      return fail(ErrorCode::kNotFound, "no column '" + printable_name(wanted[i]) +
                                            "'; there is: " + comma_list(header, printable_name));
    at[i] = static_cast<std::size_t>(found - header.begin());
  }
  return columns_at(at);
}

Expected<ImuColumns> guessed_columns(const std::vector<std::string>& header) {
  std::array<std::optional<std::size_t>, 7> found;
  const bool from_one = std::ranges::any_of(header, [](const std::string& column) {
    const ColumnName name = column_name(column);
    return name.axis == 3 && kind_of(name) != ColumnKind::kNone;
  });
  for (std::size_t i = 0; i < std::min(header.size(), kMostHeaderColumns); ++i) {
    ColumnName name = column_name(header[i]);
    const ColumnKind kind = kind_of(name);
    if (from_one) --name.axis;  // MATLAB: Gyroscope_1 to Gyroscope_3
    if (kind == ColumnKind::kNone || (kind != ColumnKind::kTime && name.axis < 0)) continue;
    const std::size_t place = kind == ColumnKind::kTime   ? 0
                              : kind == ColumnKind::kGyro ? 1 + static_cast<std::size_t>(name.axis)
                                                          : 4 + static_cast<std::size_t>(name.axis);
    // SensorLog of iOS begins with a text; its numbers are more exact.
    const bool better = place == 0 && found[0] && column_name(header[*found[0]]).unit == "txt";
    if (!found[place] || better) found[place] = i;
  }
  constexpr std::array<const char*, 7> kWhat{"time",           "gyro x",          "gyro y",
                                             "gyro z",         "accelerometer x", "accelerometer y",
                                             "accelerometer z"};
  std::string missing;
  for (std::size_t i = 0; i < 7; ++i)
    if (!found[i]) missing += (missing.empty() ? "" : ", ") + std::string(kWhat[i]);
  if (!missing.empty())
    return fail(ErrorCode::kNotFound, "no column for " + missing +
                                          "; there is: " + comma_list(header, printable_name) +
                                          ". Name the seven with --imu-columns");
  std::array<std::size_t, 7> at{};
  for (std::size_t i = 0; i < 7; ++i) at[i] = *found[i];
  return columns_at(at);
}

Expected<void> set_units(const std::vector<std::string>& header, const std::string& units,
                         ImuColumns& columns) {
  columns.time_exponent =
      unit_of(column_name(header[columns.time]), ImuColumns::kNotSaid, time_exponent_of);
  columns.gyro_unit = unit_of(column_name(header[columns.gyro[0]]), 0.0, gyro_unit_of);
  const ColumnName accel = column_name(header[columns.accel[0]]);
  columns.accel_unit = unit_of(accel, 0.0, accel_unit_of);
  columns.is_apple =  // accelerometerAccelerationX(G)
      accel.has("accelerometer") && accel.has("acceleration") && accel.unit == "g";
  if (units.empty()) {
    for (const auto& [column, unit] : {std::pair(columns.gyro[0], columns.gyro_unit),
                                       std::pair(columns.accel[0], columns.accel_unit)})
      if (unit == 0 && !column_name(header[column]).unit.empty())
        return fail(ErrorCode::kInvalid,
                    "the unit of '" + printable_name(header[column]) +
                        "' is not known: give time, gyro and accelerometer's, e.g. --imu-units "
                        "us,deg/s,g");
    return {};
  }
  const std::vector<std::string> fields = split_header(units);
  if (fields.size() == 3) {
    columns.time_exponent = time_exponent_of(fields[0]);
    columns.gyro_unit = gyro_unit_of(fields[1]);
    columns.accel_unit = accel_unit_of(fields[2]);
    if (columns.time_exponent >= 0 && columns.gyro_unit > 0 && columns.accel_unit > 0) return {};
  }
  return fail(ErrorCode::kInvalid,
              "must be three units, separated by commas: s, ms, us or ns; rad/s or deg/s; m/s^2, g "
              "or mg; is '" +
                  printable_name(units) + "'",
              "--imu-units");
}

}  // namespace

char separator_of(std::string_view line) {
  constexpr std::ptrdiff_t kSeven = 6;  // separators of seven columns
  for (const char separator : {';', '\t', ','})
    if (std::ranges::count(line, separator) >= kSeven) return separator;
  return line.find(',') == std::string_view::npos ? ' ' : ',';
}

std::vector<std::string> split_header(std::string_view line, char separator) {
  constexpr std::string_view kAround = " \t\r\n\"'";
  std::vector<std::string> names;
  if (line.starts_with("\xef\xbb\xbf")) line.remove_prefix(3);
  if (line.starts_with('#')) line.remove_prefix(1);
  if (separator == ' ') line.remove_prefix(std::min(line.find_first_not_of(kAround), line.size()));
  while (true) {
    const std::size_t end = separator == ' ' ? line.find_first_of(" \t") : line.find(separator);
    std::string_view name = line.substr(0, end);
    const std::size_t first = name.find_first_not_of(kAround);
    name = first == std::string_view::npos
               ? std::string_view()
               : name.substr(first, name.find_last_not_of(kAround) - first + 1);
    if (!name.empty() || separator != ' ') names.emplace_back(name);
    if (end == std::string_view::npos || names.size() == kMostHeaderColumns) return names;
    line.remove_prefix(end + 1);
  }
}

Expected<ImuColumns> find_imu_columns(const std::vector<std::string>& header,
                                      const std::string& names, const std::string& units) {
  auto columns = names.empty() ? guessed_columns(header) : columns_by_name(header, names);
  if (!columns) return columns;
  return set_units(header, units, *columns).map([&] { return *columns; });
}

}  // namespace fiducap
