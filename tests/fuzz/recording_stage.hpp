#pragma once

#include <filesystem>
#include <string>

#include "capture/recording/recording.hpp"
#include "capture/recording/recording_layout.hpp"
#include "fuzz/memory_file.hpp"
#include "support/temporary_folder.hpp"

namespace fiducap::fuzz {

/// A recording with one camera whose files are in memory: `link` puts a file that the harness fills
/// where the layout wants it.
class RecordingStage {
 public:
  RecordingStage() {
    std::filesystem::create_directories(layout_.mav());
    info_.folder = folder_.text();
    CameraMount camera;
    camera.model = {8, 6, 8, 8, 3.5, 2.5, Distortion::kNone, {}};
    info_.cameras = {camera};
    info_.has_images = {false};
    info_.has_corners = {true};
    info_.imu = ImuNoise{};
  }

  [[nodiscard]] const RecordingLayout& layout() const { return layout_; }
  [[nodiscard]] RecordingInfo& info() { return info_; }
  [[nodiscard]] std::string folder() const { return folder_.text(); }
  void write(const std::filesystem::path& path, std::string_view text) const {
    folder_.write(path.lexically_relative(folder_.path()).string(), text);
  }
  void link(const std::filesystem::path& path, const MemoryFile& file) const {
    std::filesystem::create_directories(path.parent_path());
    std::filesystem::create_symlink(file.path(), path);
  }

 private:
  TemporaryFolder folder_;
  RecordingLayout layout_{folder_.path()};
  RecordingInfo info_;
};

}  // namespace fiducap::fuzz
