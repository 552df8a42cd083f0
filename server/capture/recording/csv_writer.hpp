#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "base/expected.hpp"
#include "base/pose.hpp"
#include "capture/recording/output_file.hpp"

namespace fiducap {

/// Writes comma-separated lines, whatever the locale. The memory of a line is reused.
class CsvWriter final {
 public:
  /// Creates the folders above, too, and writes `header` as first line.
  [[nodiscard]] static Expected<CsvWriter> create(const std::filesystem::path& path,
                                                  std::string_view header);

  CsvWriter& integer(std::int64_t value);
  /// Rounded to `decimals` digits behind the point, trailing zeros left out.
  CsvWriter& number(double value, int decimals);
  /// The shortest text that reads back as the same number.
  CsvWriter& exact(double value);
  CsvWriter& exact(const Eigen::Vector3d& v);
  CsvWriter& vector(const Eigen::Vector3d& v, int decimals);
  /// px py pz qw qx qy qz
  CsvWriter& pose(const Pose& X, int decimals);
  CsvWriter& text(std::string_view value);
  /// Ends the line. @return Error when the disk is known not to take it.
  [[nodiscard]] Expected<void> end_line();
  [[nodiscard]] Expected<void> flush() { return file_.flush(); }
  [[nodiscard]] Expected<void> close() { return file_.close(); }
  /// That the system took.
  [[nodiscard]] std::uint64_t bytes() const { return file_.bytes(); }

 private:
  explicit CsvWriter(OutputFile file) : file_(std::move(file)) {}
  void separate();

  OutputFile file_;
  std::string line_;
};

}  // namespace fiducap
