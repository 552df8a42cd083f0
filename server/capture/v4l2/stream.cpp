#include "capture/v4l2/stream.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <linux/videodev2.h>

namespace fiducap::v4l2 {
namespace {

// A disturbed transfer fails once; after this many failures in a row the device is lost.
constexpr int kMostFailures = 10;

tl::unexpected<Error> refused(const char* what, int error) {
  return fail(ErrorCode::kUnavailable, std::string(what) + ": " + std::strerror(error));
}

tl::unexpected<Error> stream_lost(const std::string& why) {
  return fail(ErrorCode::kClosed, "gives no more images (" + why + "); is it still plugged in?");
}

KernelStamp stamp_of(const v4l2_buffer& buffer) {
  constexpr std::int64_t kAnyTime_s = 4'000'000'000;  // avoids overflow
  const std::int64_t s = buffer.timestamp.tv_sec;
  KernelStamp stamp;
  if (s < 0 || s >= kAnyTime_s) return stamp;
  stamp.ns = s * 1'000'000'000 + buffer.timestamp.tv_usec * 1000LL;
  stamp.is_monotonic =
      (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  stamp.marks_start =
      (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  return stamp;
}

}  // namespace

/// Description of a buffer for the kernel, with one or several planes; the first one has the gray.
struct Stream::Request {
  v4l2_buffer buffer{};
  std::array<v4l2_plane, VIDEO_MAX_PLANES> planes{};

  explicit Request(std::uint32_t type, std::uint32_t index = 0) {
    buffer.type = type;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    if (has_planes()) {
      buffer.m.planes = planes.data();
      buffer.length = VIDEO_MAX_PLANES;
    }
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;

  [[nodiscard]] bool has_planes() const {
    return buffer.type == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
  }
};

Expected<std::unique_ptr<Stream>> Stream::start(Port& port, const Identity& identity) {
  std::unique_ptr<Stream> stream(new Stream(port, identity));
  if (auto mapped = stream->map_buffers(); !mapped) return tl::unexpected(mapped.error());
  return stream->begin().map([&] { return std::move(stream); });
}

Expected<void> Stream::map_buffers() {
  v4l2_requestbuffers wanted{};
  wanted.count = kBuffers;
  wanted.type = identity_.buffer_type;
  wanted.memory = V4L2_MEMORY_MMAP;
  if (const int error = port_.control(VIDIOC_REQBUFS, &wanted); error == EBUSY) {
    return refused("is used by another program (find it with `fuser -v` and its name)", error);
  } else if (error != 0) {
    return refused("provides no buffers for images", error);
  }
  constexpr std::uint32_t kMostBuffers = 32;
  for (std::uint32_t i = 0; i < std::min(wanted.count, kMostBuffers); ++i) {
    Request request(identity_.buffer_type, i);
    if (const int error = port_.control(VIDIOC_QUERYBUF, &request.buffer); error != 0)
      return refused("does not report its buffers", error);
    const v4l2_plane& plane = request.planes[0];
    const auto memory = request.has_planes()
                            ? port_.map(plane.length, plane.m.mem_offset)
                            : port_.map(request.buffer.length, request.buffer.m.offset);
    if (memory.empty()) return refused("does not share its buffers", ENOMEM);
    memory_.push_back(memory);
  }
  if (memory_.size() < 2) return refused("provides too few buffers for images", ENOMEM);
  unqueued_.reserve(memory_.size());
  return {};
}

Expected<void> Stream::begin() {
  for (std::uint32_t i = 0; i < memory_.size(); ++i)
    if (const int error = queue(i); error != 0)
      return refused("does not accept its buffers", error);
  auto type = static_cast<int>(identity_.buffer_type);
  if (const int error = port_.control(VIDIOC_STREAMON, &type); error == ENOSPC) {
    return refused("USB bus is full: use a smaller size or rate, or another bus", error);
  } else if (error != 0) {
    return refused("does not start", error);
  }
  flows_ = true;
  return {};
}

Stream::~Stream() {
  auto type = static_cast<int>(identity_.buffer_type);
  if (flows_) (void)port_.control(VIDIOC_STREAMOFF, &type);
  for (const auto memory : memory_) port_.unmap(memory);
  v4l2_requestbuffers none{};
  none.type = identity_.buffer_type;
  none.memory = V4L2_MEMORY_MMAP;
  (void)port_.control(VIDIOC_REQBUFS, &none);
}

int Stream::queue(std::uint32_t index) {
  Request request(identity_.buffer_type, index);
  return port_.control(VIDIOC_QBUF, &request.buffer);
}

Expected<std::optional<FilledBuffer>> Stream::take(Duration within) {
  std::erase_if(unqueued_, [this](std::uint32_t index) { return queue(index) == 0; });
  if (unqueued_.size() == memory_.size()) return stream_lost("it accepts no buffers");
  switch (port_.wait(within)) {
    case Port::Ready::kNothing:
      return std::nullopt;
    case Port::Ready::kBroken:
      return stream_lost("its driver ended the stream");
    case Port::Ready::kImage:
      break;
  }
  Request request(identity_.buffer_type);
  if (const int error = port_.control(VIDIOC_DQBUF, &request.buffer); error != 0) {
    const bool may_recover = error == EIO || error == ENOMEM;
    if (error == EAGAIN || (may_recover && ++failures_ < kMostFailures)) return std::nullopt;
    return stream_lost(std::strerror(error));
  }
  failures_ = 0;
  const v4l2_buffer& buffer = request.buffer;
  if (buffer.index >= memory_.size()) return stream_lost("it returned an unknown buffer");
  const auto memory = memory_[buffer.index];
  const v4l2_plane& plane = request.planes[0];
  const std::size_t used = request.has_planes() ? plane.bytesused : buffer.bytesused;
  const std::size_t end = std::min(used, memory.size());
  const std::size_t begin =
      std::min<std::size_t>(request.has_planes() ? plane.data_offset : 0, end);
  FilledBuffer filled;
  filled.index = buffer.index;
  filled.bytes = memory.subspan(begin, end - begin);
  filled.stamp = stamp_of(buffer);
  filled.sequence = buffer.sequence;
  filled.damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0;
  return filled;
}

}  // namespace fiducap::v4l2
