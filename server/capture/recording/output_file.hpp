#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/expected.hpp"

namespace fiducap {

/// A file of a recording, written from its start through a buffer. Says why the disk refused; once
/// it has, the file takes nothing more.
class OutputFile final {
 public:
  /// Makes the folders above it, too; what was in the file is gone.
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
  /// That the system took.
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

/// A whole small file. @return its size
[[nodiscard]] Expected<std::uint64_t> write_output_file(const std::filesystem::path& path,
                                                        std::string_view content);

}  // namespace fiducap
