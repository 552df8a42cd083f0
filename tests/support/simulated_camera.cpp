#include "support/simulated_camera.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include <linux/videodev2.h>

namespace fiducap::v4l2 {

class SimulatedCamera::Device final : public Port {
 public:
  explicit Device(SimulatedCamera& camera) : camera_(camera) {}
  ~Device() override { camera_.mapped -= mapped_; }

  int control(unsigned long request, void* argument) override {
    if (is_unplugged()) return ENODEV;
    if (request == VIDIOC_QUERYCAP) return identify(as<v4l2_capability>(argument));
    if (request == VIDIOC_ENUM_FMT) return list_format(as<v4l2_fmtdesc>(argument));
    if (request == VIDIOC_ENUM_FRAMESIZES) return list_size(as<v4l2_frmsizeenum>(argument));
    if (request == VIDIOC_ENUM_FRAMEINTERVALS) return list_interval(as<v4l2_frmivalenum>(argument));
    if (request == VIDIOC_G_FMT) return get_format(as<v4l2_format>(argument));
    if (request == VIDIOC_S_FMT) return set_format(as<v4l2_format>(argument));
    if (request == VIDIOC_G_PARM || request == VIDIOC_S_PARM)
      return get_rate(as<v4l2_streamparm>(argument));
    if (request == VIDIOC_QUERYCTRL) return describe_knob(as<v4l2_queryctrl>(argument));
    if (request == VIDIOC_QUERYMENU) return describe_choice(as<v4l2_querymenu>(argument));
    if (request == VIDIOC_G_CTRL || request == VIDIOC_S_CTRL)
      return turn_knob(request, as<v4l2_control>(argument));
    if (request == VIDIOC_REQBUFS) return allocate(as<v4l2_requestbuffers>(argument));
    if (request == VIDIOC_QUERYBUF) return describe_buffer(as<v4l2_buffer>(argument));
    if (request == VIDIOC_QBUF) return queue(as<v4l2_buffer>(argument));
    if (request == VIDIOC_DQBUF) return hand_over(as<v4l2_buffer>(argument));
    if (request == VIDIOC_STREAMON || request == VIDIOC_STREAMOFF)
      return set_stream(request == VIDIOC_STREAMON);
    return ENOTTY;
  }

  std::span<std::byte> map(std::size_t length, std::uint32_t offset) override {
    if (offset >= memory_.size() || length != memory_[offset].size()) return {};
    ++mapped_;
    ++camera_.mapped;
    return memory_[offset];
  }
  void unmap(std::span<std::byte>) override {
    --mapped_;
    --camera_.mapped;
  }

  Ready wait(Duration at_most) override {
    if (is_unplugged()) return Ready::kBroken;
    const Instant until = camera_.clock.now() + at_most;
    while (filled_.empty()) {
      if (!flows_ || next_end_ > until || camera_.image >= camera_.stops_at.value_or(~0u)) {
        camera_.clock.advance(until - camera_.clock.now());
        return Ready::kNothing;
      }
      if (next_end_ > camera_.clock.now()) camera_.clock.advance(next_end_ - camera_.clock.now());
      expose();
      if (is_unplugged()) return Ready::kBroken;
    }
    return Ready::kImage;
  }

 private:
  template <typename T>
  static T& as(void* argument) {
    return *static_cast<T*>(argument);
  }
  static std::uint32_t u32(int value) { return static_cast<std::uint32_t>(value); }
  static v4l2_fract interval(double hz) {
    return {1000, static_cast<std::uint32_t>(std::lround(hz * 1000))};
  }
  [[nodiscard]] bool is_unplugged() const {
    return camera_.unplugged_at && camera_.image >= *camera_.unplugged_at;
  }
  [[nodiscard]] std::size_t stride() const {
    const auto width = static_cast<std::size_t>(camera_.mode.size.width);
    const auto code = camera_.mode.code;
    const bool two_bytes =
        code == V4L2_PIX_FMT_YUYV || code == V4L2_PIX_FMT_UYVY || code == V4L2_PIX_FMT_Y10;
    return width * (two_bytes ? 2 : 1) + camera_.row_padding;
  }
  [[nodiscard]] std::size_t image_bytes() const {
    return std::max(stride() * static_cast<std::size_t>(camera_.mode.size.height),
                    camera_.jpeg.size());
  }

  int identify(v4l2_capability& out) const {
    std::memcpy(out.driver, camera_.driver.c_str(), camera_.driver.size());
    std::memcpy(out.card, "Simulated", 9);
    out.capabilities = camera_.capabilities;
    return 0;
  }

  std::vector<std::uint32_t> codes() const {
    std::vector<std::uint32_t> codes;
    for (const Offer& offer : camera_.offers)
      if (std::find(codes.begin(), codes.end(), offer.code) == codes.end())
        codes.push_back(offer.code);
    return codes;
  }
  int list_format(v4l2_fmtdesc& entry) const {
    if (entry.index >= codes().size()) return EINVAL;
    entry.pixelformat = codes()[entry.index];
    std::memcpy(entry.description, "Some", 4);
    return 0;
  }
  int list_size(v4l2_frmsizeenum& entry) const {
    std::vector<PixelSize> sizes;
    for (const Offer& offer : camera_.offers)
      if (offer.code == entry.pixel_format) sizes.push_back(offer.size);
    if (entry.index >= sizes.size()) return EINVAL;
    entry.type = V4L2_FRMSIZE_TYPE_DISCRETE;
    entry.discrete = {u32(sizes[entry.index].width), u32(sizes[entry.index].height)};
    return 0;
  }
  const Offer* offer_of(std::uint32_t code, std::uint32_t width, std::uint32_t height) const {
    for (const Offer& offer : camera_.offers)
      if (offer.code == code &&
          offer.size == PixelSize{static_cast<int>(width), static_cast<int>(height)})
        return &offer;
    return nullptr;
  }
  int list_interval(v4l2_frmivalenum& entry) const {
    const Offer* offer = offer_of(entry.pixel_format, entry.width, entry.height);
    if (offer == nullptr || entry.index > 0 || offer->promised_hz == 0) return EINVAL;
    entry.type = V4L2_FRMIVAL_TYPE_DISCRETE;
    entry.discrete = interval(offer->promised_hz);
    return 0;
  }
  int get_format(v4l2_format& format) const {
    format.fmt.pix.pixelformat = camera_.mode.code;
    format.fmt.pix.width = u32(camera_.mode.size.width);
    format.fmt.pix.height = u32(camera_.mode.size.height);
    format.fmt.pix.bytesperline = static_cast<std::uint32_t>(stride());
    return 0;
  }
  int set_format(v4l2_format& format) {
    if (!memory_.empty()) return EBUSY;
    const auto& pix = format.fmt.pix;
    const Offer* offer = offer_of(pix.pixelformat, pix.width, pix.height);
    camera_.mode = offer != nullptr ? *offer : camera_.offers.front();
    return get_format(format);
  }
  int get_rate(v4l2_streamparm& rate) const {
    rate.parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
    rate.parm.capture.timeperframe = interval(camera_.mode.promised_hz);
    return 0;
  }

  int describe_knob(v4l2_queryctrl& out) const {
    auto found = camera_.knobs.find(out.id);
    if ((out.id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0)
      found = camera_.knobs.upper_bound(out.id & ~std::uint32_t{V4L2_CTRL_FLAG_NEXT_CTRL});
    if (found == camera_.knobs.end()) return EINVAL;
    const auto& [id, knob] = *found;
    out.id = id;
    out.type = knob.type;
    std::memcpy(out.name, knob.name.c_str(), std::min<std::size_t>(knob.name.size(), 31));
    out.minimum = knob.minimum;
    out.maximum = knob.maximum;
    out.step = knob.step;
    out.flags = 0;
    return 0;
  }
  int describe_choice(v4l2_querymenu& entry) const {
    const auto found = camera_.knobs.find(entry.id);
    if (found == camera_.knobs.end() ||
        !found->second.choices.contains(static_cast<std::int32_t>(entry.index)))
      return EINVAL;
    std::memcpy(entry.name, "choice", 6);
    return 0;
  }
  int turn_knob(unsigned long request, v4l2_control& entry) {
    const auto found = camera_.knobs.find(entry.id);
    if (found == camera_.knobs.end()) return EINVAL;
    Knob& knob = found->second;
    if (request == VIDIOC_S_CTRL) {
      if (!knob.choices.empty() && !knob.choices.contains(entry.value)) return EINVAL;
      const std::int32_t value = std::clamp(entry.value, knob.minimum, knob.maximum);
      knob.value = value - (value - knob.minimum) % knob.step;
      camera_.set[entry.id] = knob.value;
    }
    entry.value = knob.value;
    return 0;
  }

  int allocate(const v4l2_requestbuffers& wanted) {
    memory_.assign(wanted.count, std::vector<std::byte>(image_bytes()));
    queued_.clear();
    return 0;
  }
  int describe_buffer(v4l2_buffer& buffer) const {
    buffer.length = static_cast<std::uint32_t>(memory_[buffer.index].size());
    buffer.m.offset = buffer.index;
    return 0;
  }
  int queue(const v4l2_buffer& buffer) {
    if (flows_ && camera_.qbuf_failures > 0) return --camera_.qbuf_failures, EINVAL;
    queued_.push_back(buffer.index);
    return 0;
  }
  int set_stream(bool flows) {
    flows_ = flows;
    if (!flows) filled_.clear();
    if (flows) ++camera_.streams;
    if (flows) next_end_ = camera_.clock.now() + period();
    return 0;
  }

  [[nodiscard]] Duration period() const { return from_seconds(1 / camera_.mode.true_hz); }

  /// An image has ended; it goes into the oldest free buffer, or is lost.
  void expose() {
    const std::uint32_t number = camera_.image++;
    const Instant ended = next_end_;
    next_end_ += period();
    if (camera_.skipped.contains(number) || queued_.empty()) return;
    const std::uint32_t index = queued_.front();
    queued_.erase(queued_.begin());
    v4l2_buffer buffer{};
    buffer.index = index;
    buffer.sequence = camera_.first_sequence + number;
    buffer.flags = camera_.stamp_flags;
    if (camera_.damaged.contains(number)) buffer.flags |= V4L2_BUF_FLAG_ERROR;
    const Duration back = camera_.repeated_stamps.contains(number) ? period() : Duration{0};
    const std::int64_t us = to_ns(ended + camera_.stamp_offset - back) / 1000;
    buffer.timestamp.tv_sec = us / 1'000'000;
    buffer.timestamp.tv_usec = us % 1'000'000;
    buffer.bytesused = static_cast<std::uint32_t>(fill(memory_[index], number));
    if (camera_.shortened.contains(number)) buffer.bytesused /= 2;
    filled_.push_back(buffer);
  }

  /// Every byte is the number of the image, so also the upper eight bits of Y10.
  std::size_t fill(std::vector<std::byte>& memory, std::uint32_t number) const {
    if (camera_.mode.code == V4L2_PIX_FMT_MJPEG) {
      std::memcpy(memory.data(), camera_.jpeg.data(), camera_.jpeg.size());
      return camera_.jpeg.size();
    }
    const std::size_t used = stride() * static_cast<std::size_t>(camera_.mode.size.height);
    std::fill_n(memory.begin(), used, static_cast<std::byte>(number));
    return used;
  }

  int hand_over(v4l2_buffer& buffer) {
    if (camera_.dqbuf_failures > 0) {
      --camera_.dqbuf_failures;
      if (!filled_.empty()) {
        queued_.push_back(filled_.front().index);
        filled_.erase(filled_.begin());
      }
      return EIO;
    }
    if (filled_.empty()) return EAGAIN;
    buffer = filled_.front();
    filled_.erase(filled_.begin());
    return 0;
  }

  SimulatedCamera& camera_;
  std::vector<std::vector<std::byte>> memory_;
  std::vector<std::uint32_t> queued_;  // short vectors: no allocation after warm-up
  std::vector<v4l2_buffer> filled_;
  bool flows_{false};
  Instant next_end_{};
  int mapped_{0};
};

std::unique_ptr<Port> SimulatedCamera::open() {
  if (mode.size.width == 0) mode = offers.front();
  return std::make_unique<Device>(*this);
}

}  // namespace fiducap::v4l2
