#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace fiducap::vicon {

/// A client's state of a stream. Shares no code with the server, applies the strictest rules seen
/// in SDK 1.3 to 1.12 and collects every violation: framing, order, counts, and the values that are
/// kept or forgotten from frame to frame.
class StreamView final {
 public:
  using NamedValues = std::vector<std::pair<std::string, double>>;
  struct Pose {
    std::array<double, 3> t{};
    std::array<double, 9> R{};
  };
  struct LightPose {
    std::array<float, 3> t{};
    std::array<float, 3> r{};
  };

  /// Whole packets, without anything between them. @return bytes used
  std::size_t take(std::span<const std::byte> bytes) {
    std::size_t used = 0;
    for (;;) {
      const auto rest = bytes.subspan(used);
      if (rest.size() < 8) return used;
      if (u32(rest) != 0x1A2B0001) {
        violated("wrong tag");
        return bytes.size();
      }
      const std::size_t size = 8 + std::size_t{u32(rest.subspan(4))};
      if (rest.size() < size) return used;
      take_packet(rest.subspan(8, size - 8));
      used += size;
    }
  }

  std::set<std::uint32_t> requested;  ///< Other types are a violation.

  bool greeted{false};
  std::set<std::uint32_t> offered;
  int frames{0}, frames_with_statics{0};
  std::uint32_t frame_id{0}, hardware_number{0};
  double rate_hz{0};
  int up{-1};
  std::map<std::uint32_t, std::string> names;
  std::set<std::uint32_t> topologies, scales;
  std::map<std::uint32_t, double> qualities;
  std::map<std::uint32_t, Pose> globals, locals;
  std::map<std::uint32_t, LightPose> lights;
  NamedValues latency, rates;
  std::string timecode;  ///< Raw.
  std::vector<std::string> violations;

  [[nodiscard]] std::uint32_t id_of(const std::string& name) const {
    for (const auto& [id, one] : names) {
      if (one == name) return id;
    }
    return 0;
  }

 private:
  using Bytes = std::span<const std::byte>;

  template <typename T>
  T get(Bytes& in) {
    T value{};
    if (in.size() < sizeof(T)) {
      violated("an object is too short");
      in = {};
      return value;
    }
    std::memcpy(&value, in.data(), sizeof(T));
    in = in.subspan(sizeof(T));
    return value;
  }
  static std::uint32_t u32(Bytes in) {
    std::uint32_t value = 0;
    std::memcpy(&value, in.data(), 4);
    return value;
  }
  std::string raw(Bytes& in, std::size_t n) {
    if (in.size() < n) {
      violated("a text is too long");
      return {};
    }
    std::string out(reinterpret_cast<const char*>(in.data()), n);
    in = in.subspan(n);
    return out;
  }
  std::string text(Bytes& in) { return raw(in, get<std::uint32_t>(in)); }
  NamedValues named_values(Bytes& in) {
    NamedValues values(get<std::uint32_t>(in));
    for (auto& [name, value] : values) {
      name = text(in);
      value = get<double>(in);
    }
    return values;
  }
  template <typename T, std::size_t N>
  std::array<T, N> many(Bytes& in) {
    std::array<T, N> values{};
    for (T& value : values) value = get<T>(in);
    return values;
  }
  std::uint32_t only_segment(Bytes& in) {
    const auto subject = get<std::uint32_t>(in);
    expect(subject != 0, "subject id 0");
    expect(get<std::uint32_t>(in) == 1, "not one segment");
    expect(get<std::uint32_t>(in) == 1, "segment id is not 1");
    return subject;
  }
  void expect(bool holds, const std::string& what) {
    if (!holds) violated(what);
  }
  void violated(const std::string& what) {
    violations.push_back("frame " + std::to_string(frames) + ": " + what);
  }

  void take_packet(Bytes objects);
  void take_frame(const std::vector<std::pair<std::uint32_t, Bytes>>& objects);
  void take_contents(Bytes in, const std::map<std::uint32_t, std::uint32_t>& found);
  void forget(std::uint32_t type);
  void take_object(std::uint32_t type, Bytes in);
  void take_subject(Bytes& in);
  void take_frame_id(std::uint32_t id);

  static bool is_kept(std::uint32_t type) {
    return type == 1 || type == 2 || type == 28 || type == 37 || type == 40 || type == 28001;
  }
};

}  // namespace fiducap::vicon
