#include "capture/recording/csv_writer.hpp"

#include <charconv>

namespace fiducap {

Expected<CsvWriter> CsvWriter::create(const std::filesystem::path& path, std::string_view header) {
  auto file = OutputFile::create(path);
  if (!file) return tl::unexpected(file.error());
  CsvWriter writer(std::move(*file));
  if (const auto done = writer.text(header).end_line(); !done) return tl::unexpected(done.error());
  if (const auto done = writer.flush(); !done) return tl::unexpected(done.error());
  return writer;
}

void CsvWriter::separate() {
  if (!line_.empty()) line_ += ',';
}

CsvWriter& CsvWriter::integer(std::int64_t value) {
  separate();
  char digits[24];
  line_.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
  return *this;
}

CsvWriter& CsvWriter::number(double value, int decimals) {
  separate();
  char digits[400];  // the largest double has 309 digits before the point
  const char* end =
      std::to_chars(digits, digits + sizeof(digits), value, std::chars_format::fixed, decimals).ptr;
  std::string_view text(digits, static_cast<std::size_t>(end - digits));
  if (text.find('.') != std::string_view::npos) {
    text = text.substr(0, text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.remove_suffix(1);
  }
  line_ += text;
  return *this;
}

CsvWriter& CsvWriter::exact(double value) {
  separate();
  char digits[32];
  line_.append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
  return *this;
}

CsvWriter& CsvWriter::exact(const Eigen::Vector3d& v) {
  return exact(v.x()).exact(v.y()).exact(v.z());
}

CsvWriter& CsvWriter::vector(const Eigen::Vector3d& v, int decimals) {
  return number(v.x(), decimals).number(v.y(), decimals).number(v.z(), decimals);
}

CsvWriter& CsvWriter::pose(const Pose& X, int decimals) {
  vector(X.p, decimals).number(X.q.w(), decimals);
  return vector(X.q.vec(), decimals);
}

CsvWriter& CsvWriter::text(std::string_view value) {
  separate();
  line_ += value;
  return *this;
}

Expected<void> CsvWriter::end_line() {
  line_ += '\n';
  auto done = file_.write(line_);
  line_.clear();
  return done;
}

}  // namespace fiducap
