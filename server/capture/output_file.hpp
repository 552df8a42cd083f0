#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "base/pose.hpp"

namespace fiducap {

/// A file written from its start through a buffer. After an error it accepts nothing more.
class OutputFile final {
 public:
  /// Creates the folders above it, too; truncates an existing file.
  [[nodiscard]] static Expected<OutputFile> create(const std::filesystem::path& path);
  ~OutputFile();
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&& other) noexcept;
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  /// To the buffer; to the disk when that is full.
  [[nodiscard]] Expected<void> write(std::string_view bytes);
  /// Hands the buffer to the system: what was written survives the end of the process.
  [[nodiscard]] Expected<void> flush();
  [[nodiscard]] Expected<void> close();
  /// Bytes that the system accepted.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

 private:
  OutputFile(std::filesystem::path path, int descriptor)
      : path_(std::move(path)), descriptor_(descriptor) {}
  tl::unexpected<Error> refused(int error);

  std::filesystem::path path_;
  int descriptor_{-1};
  std::string buffer_;
  std::uint64_t bytes_{0};
  std::optional<Error> failure_;
};

/// Writes a whole small file. @return its size
[[nodiscard]] Expected<std::uint64_t> write_output_file(const std::filesystem::path& path,
                                                        std::string_view content);

/// Writes comma-separated lines, independent of the locale. The memory of a line is reused.
class CsvWriter final {
 public:
  /// As OutputFile::create; writes `header` as first line.
  [[nodiscard]] static Expected<CsvWriter> create(const std::filesystem::path& path,
                                                  std::string_view header);

  CsvWriter& integer(std::int64_t value);
  /// Rounded to `decimals` digits behind the point, without trailing zeros.
  CsvWriter& number(double value, int decimals);
  /// The shortest text that reads back as the same number.
  CsvWriter& exact(double value);
  CsvWriter& exact(const Eigen::Vector3d& v);
  CsvWriter& vector(const Eigen::Vector3d& v, int decimals) {
    return number(v.x(), decimals).number(v.y(), decimals).number(v.z(), decimals);
  }
  /// px py pz qw qx qy qz
  CsvWriter& pose(const Pose& X, int decimals) {
    vector(X.p, decimals).number(X.q.w(), decimals);
    return vector(X.q.vec(), decimals);
  }
  CsvWriter& text(std::string_view value) {
    separate();
    line_ += value;
    return *this;
  }
  /// Ends the line. @return Error when the disk is known not to take it.
  [[nodiscard]] Expected<void> end_line() {
    line_ += '\n';
    auto done = file_.write(line_);
    line_.clear();
    return done;
  }
  [[nodiscard]] Expected<void> flush() { return file_.flush(); }
  [[nodiscard]] Expected<void> close() { return file_.close(); }
  [[nodiscard]] std::uint64_t bytes() const { return file_.bytes(); }

 private:
  explicit CsvWriter(OutputFile file) : file_(std::move(file)) {}
  void separate() {
    if (!line_.empty()) line_ += ',';
  }

  OutputFile file_;
  std::string line_;
};

}  // namespace fiducap
