#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "base/expected.hpp"
#include "base/pose.hpp"

namespace fiducap {

/// One map of a YAML calibration file. Getters never throw: what is broken or missing is collected,
/// with its place, and `check` gives it all at once. Included only by the files that read such a
/// format.
class YamlSection final {
 public:
  /// Accepts OpenCV's `%YAML:1.0` first line, and JSON, which is a kind of YAML.
  [[nodiscard]] static Expected<YamlSection> load(const std::filesystem::path& path);

  [[nodiscard]] bool has(const std::string& key) const;
  [[nodiscard]] bool is_map(const std::string& key) const;
  /// The map below `key`; a section without keys when there is none.
  [[nodiscard]] YamlSection section(const std::string& key) const;
  /// The maps of the list below `key`; empty when there is none.
  [[nodiscard]] std::vector<YamlSection> sections(const std::string& key) const;

  /// Absent: nullopt. Not a finite number: a fault and nullopt.
  [[nodiscard]] std::optional<double> number(const std::string& key) const;
  [[nodiscard]] std::optional<int> integer(const std::string& key) const;
  [[nodiscard]] std::optional<std::string> text(const std::string& key) const;
  [[nodiscard]] std::optional<bool> flag(const std::string& key) const;
  /// A list, nested lists row by row, or OpenCV's {rows, cols, data}. Absent: empty.
  [[nodiscard]] std::vector<double> numbers(const std::string& key) const;
  /// A 4 × 4 matrix as a pose; a fault when it is not a rigid one.
  [[nodiscard]] std::optional<Pose> pose(const std::string& key) const;
  /// `key: value` pairs of a map id → number.
  [[nodiscard]] std::vector<std::pair<int, double>> numbers_by_id(const std::string& key) const;
  /// The same getters, where absence is a fault.
  [[nodiscard]] double required_number(const std::string& key) const;
  [[nodiscard]] int required_integer(const std::string& key) const;
  [[nodiscard]] std::vector<double> required_numbers(const std::string& key,
                                                     std::size_t count) const;
  [[nodiscard]] Pose required_pose(const std::string& key) const;

  void complain(const std::string& key, const std::string& text) const;
  /// Error with all faults of the file so far, this section's parents and children included.
  [[nodiscard]] Expected<void> check() const;

 private:
  struct Faults {
    std::string file;
    std::vector<std::string> list;
  };
  YamlSection(YAML::Node node, std::string place, std::shared_ptr<Faults> faults)
      : node_(std::move(node)), place_(std::move(place)), faults_(std::move(faults)) {}
  [[nodiscard]] YAML::Node find(const std::string& key) const;
  void append_numbers(const std::string& key, const YAML::Node& node, int depth,
                      std::vector<double>& out) const;

  YAML::Node node_;
  std::string place_;  ///< Keys above, `cam0.`
  std::shared_ptr<Faults> faults_;
};

/// A rigid pose of a row-major 4 × 4 matrix. Error says in what way it is not rigid.
[[nodiscard]] Expected<Pose> pose_of_matrix(const std::vector<double>& row_major);

/// Reads a text file of at most `kMaxCalibrationFile_bytes`.
[[nodiscard]] Expected<std::string> read_calibration_text(const std::filesystem::path& path);

}  // namespace fiducap
