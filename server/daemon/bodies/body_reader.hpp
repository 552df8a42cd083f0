#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/event_board.hpp"
#include "capture/image_watch.hpp"
#include "capture/sensor_source.hpp"

namespace fiducap {

/// One of a body's sources.
struct BodySource {
  std::unique_ptr<SensorSource> samples;
  std::string name{"source"};  ///< In words, after `its`.
  /// When the last of these has ended, so has the body.
  bool gives_images{true};
  /// What its images are held against, by camera of the body; those of others are not watched.
  std::vector<ImageWatch::Promise> promises{};
};

/// Waits for one source of a body and passes on what it gives: a plain function for a thread to
/// run. Images that are wrong (black, frozen, half, too few) are said. What the source throws is
/// said, and it is read on, after pauses that grow to half a minute.
class BodyReader final {
 public:
  /// @return false: nothing is taken any more
  using Take = std::function<bool(SensorSample)>;

  BodyReader(BodySource source, std::string body, Take take, EventBoard& events,
             const Clock& clock);

  /// Until the source ends, fails or is stopped, or nothing is taken any more.
  void read(std::stop_token stop);
  /// read() has returned. From any thread.
  [[nodiscard]] bool reading() const { return reading_; }
  [[nodiscard]] bool gives_images() const { return source_.gives_images; }

 private:
  void read_samples(std::stop_token stop);
  void look_at(const CameraFrame& image);
  void tell(std::size_t camera, const ImageDoubt& doubt);
  void say_that_it_failed(const char* why);

  BodySource source_;
  std::string body_;
  Take take_;
  EventBoard& events_;
  const Clock& clock_;
  std::atomic<bool> reading_{true};
  bool failed_{false};               ///< And no sample since.
  std::vector<ImageWatch> watches_;  ///< By camera of the body.
};

}  // namespace fiducap
