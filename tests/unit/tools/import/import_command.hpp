#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "support/command_run.hpp"
#include "tools/import/import.hpp"
#include "unit/tools/import/recorded_samples.hpp"

namespace fiducap {

inline constexpr std::int64_t kBegin_ns = 1'600'000'000'000'000'000;
inline constexpr std::int64_t kReading_ns = 5'000'000;

inline std::string picture(int brightness, int type = CV_8UC1) {
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", cv::Mat(48, 64, type, cv::Scalar(brightness)), bytes);
  return {bytes.begin(), bytes.end()};
}

class ImportCommandTest : public VerbTest<ImportArguments> {
 protected:
  ImportCommandTest() { arguments_.out = folder_.file("recording"); }

  void run_all(std::vector<std::string> sources, int exit_code = kExitOk) {
    arguments_.sources = std::move(sources);
    VerbTest::run(run_import, exit_code);
  }
  void run(const std::string& source, int exit_code = kExitOk) { run_all({source}, exit_code); }
  [[nodiscard]] RecordingInfo recording() const {
    return value_of(read_recording_info(arguments_.out));
  }
  [[nodiscard]] std::vector<ImuSample> readings() const {
    return recorded<ImuSample>(arguments_.out);
  }
  [[nodiscard]] std::vector<CameraFrame> images() const {
    return recorded<CameraFrame>(arguments_.out);
  }
};

}  // namespace fiducap
