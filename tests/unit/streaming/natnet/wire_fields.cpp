#include "wire_fields.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "base/bytes.hpp"
#include "streaming/natnet/codec.hpp"

namespace fiducap::natnet {

namespace {

constexpr std::int32_t kMost = 1000;  // of anything in a list

/// Reads and notes; after the first field that is not there, nothing is.
class Parts final {
 public:
  Parts(std::span<const std::byte> frame, Bitstream version)
      : in_(frame), version_(version), into_(&frame_.fields) {}

  std::optional<WireFrame> all() {
    in_.bytes(kHeaderSize);
    i32("frame");
    list("marker_sets", [this] {
      text("marker_set.name");
      list("marker_set.markers", [this] { vector("marker_set.marker"); });
    });
    list("other_markers", [this] { vector("other_marker"); });
    list("bodies", [this] { body(); });
    list("skeletons", [this] { broken_ = true; });
    list("labeled_markers", [this] { labeled_marker(); });
    if (since(2, 9)) list("force_plates", [this] { broken_ = true; });
    if (since(2, 11)) list("devices", [this] { broken_ = true; });
    suffix();
    if (broken_ || in_.failed() || in_.left() != 0) return std::nullopt;
    return frame_;
  }

 private:
  [[nodiscard]] bool since(int major, int minor) const {
    return version_ >=
           Bitstream{static_cast<std::uint8_t>(major), static_cast<std::uint8_t>(minor)};
  }
  void note(const std::string& name, double value) { into_->push_back({name, value}); }
  std::int32_t i32(const std::string& name) {
    const std::int32_t value = in_.i32();
    note(name, value);
    return value;
  }
  void i16(const std::string& name) { note(name, in_.i16()); }
  void f32(const std::string& name) { note(name, in_.f32()); }
  void f64(const std::string& name) { note(name, in_.f64()); }
  void u64(const std::string& name) { note(name, static_cast<double>(in_.u64())); }
  void vector(const std::string& name) {
    for (const char* axis : {".x", ".y", ".z"}) f32(name + axis);
  }
  void text(const std::string& name) {
    int length = 0;
    while (!in_.failed() && in_.u8() != 0) ++length;
    note(name, length);
  }
  template <typename Item>
  void list(const std::string& name, Item item) {
    const std::int32_t n = i32(name);
    broken_ = broken_ || n < 0 || n > kMost;
    for (std::int32_t i = 0; i < n && !broken_ && !in_.failed(); ++i) item();
  }
  void body() {
    into_ = &frame_.bodies.emplace_back();
    i32("body.id");
    vector("body.p");
    for (const char* part : {"body.qx", "body.qy", "body.qz", "body.qw"}) f32(part);
    if (!since(3, 0)) {
      const std::int32_t n = i32("body.markers");
      broken_ = broken_ || n < 0 || n > kMost;
      for (std::int32_t i = 0; i < n && !broken_; ++i) in_.bytes(12 + 4 + 4);  // p, id, size
    }
    f32("body.mean_error");
    if (since(2, 6)) i16("body.params");
    into_ = &frame_.fields;
  }
  void labeled_marker() {
    i32("labeled.id");
    vector("labeled.p");
    f32("labeled.size");
    if (since(2, 6)) i16("labeled.params");
    if (since(3, 0)) f32("labeled.residual");
  }
  void suffix() {
    if (!since(3, 0)) f32("latency");
    i32("timecode");
    i32("timecode_sub");
    if (since(2, 7))
      f64("timestamp");
    else if (since(2, 6))
      f32("timestamp");
    if (since(3, 0)) {
      for (const char* stamp : {"mid_exposure", "data_received", "transmit"}) u64(stamp);
    }
    if (since(2, 6)) i16("params");
    i32("end");
  }

  LittleEndianReader in_;
  Bitstream version_;
  WireFrame frame_;
  std::vector<WireField>* into_;
  bool broken_{false};
};

std::uint32_t little(const std::vector<std::byte>& bytes, std::size_t at) {
  const std::span<const std::byte> all = bytes;
  LittleEndianReader in{all.subspan(std::min(at, all.size()))};
  return in.u32();
}
std::uint16_t big16(std::span<const std::byte> bytes) {
  return static_cast<std::uint16_t>((std::to_integer<unsigned>(bytes[0]) << 8U) |
                                    std::to_integer<unsigned>(bytes[1]));
}

/// @return nothing for what is no UDP in IPv4
std::optional<CapturedDatagram> datagram_in(std::span<const std::byte> packet) {
  constexpr std::size_t kEthernet = 14;
  if (packet.size() < kEthernet + 20 || big16(packet.subspan(12)) != 0x0800) return std::nullopt;
  const auto ip = packet.subspan(kEthernet);
  const std::size_t header = (std::to_integer<std::size_t>(ip[0]) & 15U) * 4;
  if (ip[9] != std::byte{17} || ip.size() < header + 8) return std::nullopt;
  const auto udp = ip.subspan(header);
  const std::size_t length = big16(udp.subspan(4));
  if (length < 8 || length > udp.size()) return std::nullopt;
  const auto payload = udp.first(length).subspan(8);
  return CapturedDatagram{{payload.begin(), payload.end()}, big16(udp), big16(udp.subspan(2))};
}

}  // namespace

std::optional<double> WireFrame::operator[](const std::string& name) const {
  for (const WireField& field : fields) {
    if (field.name == name) return field.value;
  }
  return std::nullopt;
}

std::vector<std::string> WireFrame::structure() const {
  std::vector<std::string> names;
  const auto add = [&](const WireField& field) {
    if (std::find(names.begin(), names.end(), field.name) == names.end())
      names.push_back(field.name);
  };
  std::for_each(fields.begin(), fields.end(), add);
  if (!bodies.empty()) std::for_each(bodies[0].begin(), bodies[0].end(), add);
  return names;
}

std::optional<WireFrame> take_apart(std::span<const std::byte> frame, Bitstream version) {
  return Parts(frame, version).all();
}

std::vector<CapturedDatagram> read_capture(const std::string& file) {
  constexpr std::uint32_t kEnhancedPacket = 6;
  const auto bytes = read_bytes(file);
  std::vector<CapturedDatagram> all;
  for (std::size_t at = 0; at + 12 <= bytes.size();) {
    const std::size_t length = little(bytes, at + 4);
    if (length < 12 || length > bytes.size() - at) break;
    const std::size_t captured = little(bytes, at + 20);
    if (little(bytes, at) == kEnhancedPacket && length >= 32 && captured <= length - 32) {
      auto datagram = datagram_in(std::span(bytes).subspan(at + 28, captured));
      if (datagram) all.push_back(std::move(*datagram));
    }
    at += length;
  }
  return all;
}

std::vector<std::byte> read_bytes(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto* first = reinterpret_cast<const std::byte*>(text.data());
  return {first, first + text.size()};
}

}  // namespace fiducap::natnet
