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

/// What a client knows of a stream. Shares no code with the server, applies the strictest rules seen in SDK 1.3 to 1.12 and
/// collects every violation: framing, order, counts, what is kept and what is forgotten from frame to frame.
class StreamView final {
 public:
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

  std::set<std::uint32_t> requested;  ///< By the client; what else comes is a violation.

  bool greeted{false};
  std::set<std::uint32_t> offered;
  int frames{0};
  int frames_with_statics{0};
  std::uint32_t frame_id{0};
  std::uint32_t hardware_number{0};
  double rate_hz{0};
  int up{-1};
  std::map<std::uint32_t, std::string> names;
  std::set<std::uint32_t> topologies;
  std::set<std::uint32_t> scales;
  std::map<std::uint32_t, double> qualities;
  std::map<std::uint32_t, Pose> globals;
  std::map<std::uint32_t, Pose> locals;
  std::map<std::uint32_t, LightPose> lights;
  std::vector<std::pair<std::string, double>> latency;
  std::map<std::string, double> rates;
  std::string timecode;  ///< Raw.
  std::vector<std::uint64_t> pongs;
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
  std::string text(Bytes& in) {
    const auto n = get<std::uint32_t>(in);
    if (in.size() < n) {
      violated("a text is too long");
      return {};
    }
    std::string out(reinterpret_cast<const char*>(in.data()), n);
    in = in.subspan(n);
    return out;
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
  void violated(const std::string& what) { violations.push_back("frame " + std::to_string(frames) + ": " + what); }

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

inline void StreamView::take_packet(Bytes in) {
  std::vector<std::pair<std::uint32_t, Bytes>> objects;
  while (!in.empty()) {
    const auto type = get<std::uint32_t>(in);
    const auto length = get<std::uint32_t>(in);
    if (in.size() < length) return violated("objects do not fill the packet exactly");
    objects.emplace_back(type, in.first(length));
    in = in.subspan(length);
  }
  if (objects.empty()) return violated("an empty packet counts as a frame");
  if (!greeted) {
    expect(objects.size() == 1 && objects[0].first == 100001, "does not begin with a greeting of its own");
    greeted = true;
    Bytes types = objects[0].second;
    const auto n = get<std::uint32_t>(types);
    for (std::uint32_t i = 0; i < n; ++i) offered.insert(get<std::uint32_t>(types));
    return expect(types.empty() && offered.size() == n, "greeting is malformed");
  }
  if (objects[0].first == 42) {
    expect(objects.size() == 1 && objects[0].second.size() == 8, "a pong is not alone");
    pongs.push_back(get<std::uint64_t>(objects[0].second));
    return;
  }
  take_frame(objects);
}

inline void StreamView::take_frame(const std::vector<std::pair<std::uint32_t, Bytes>>& objects) {
  ++frames;
  expect(!requested.empty(), "comes before the client said what it wants");
  std::map<std::uint32_t, std::uint32_t> found;
  for (const auto& [type, bytes] : objects) ++found[type];
  expect(objects[0].first == 100004 && found[100004] == 1, "contents are not first and once");
  expect(found[5] == 1, "not one frame number");
  for (const auto& [type, n] : found) expect(requested.contains(type), "type " + std::to_string(type) + " not asked for");
  if (requested.contains(26)) expect(found[26] == 1, "no latency");
  take_contents(objects[0].second, found);
  globals.clear();
  locals.clear();
  lights.clear();
  if (found[2] + found[1] > 0) ++frames_with_statics;
  for (const auto& [type, bytes] : objects) {
    if (type != 100004) take_object(type, bytes);
  }
  for (const auto& [id, pose] : globals) expect(names.contains(id), "pose of an unknown subject");
  for (const auto& [id, pose] : lights) expect(names.contains(id), "light pose of an unknown subject");
}

inline void StreamView::take_contents(Bytes in, const std::map<std::uint32_t, std::uint32_t>& found) {
  const auto n_counts = get<std::uint32_t>(in);
  std::set<std::uint32_t> counted;
  for (std::uint32_t i = 0; i < n_counts; ++i) {
    const auto type = get<std::uint32_t>(in);
    const auto n = get<std::uint32_t>(in);
    expect(counted.empty() || *counted.rbegin() < type, "contents do not ascend");
    counted.insert(type);
    const auto there = found.find(type);
    expect(n == (there == found.end() ? 0 : there->second), "wrong count of type " + std::to_string(type));
  }
  std::set<std::uint32_t> unchanged;
  const auto n_unchanged = get<std::uint32_t>(in);
  for (std::uint32_t i = 0; i < n_unchanged; ++i) unchanged.insert(get<std::uint32_t>(in));
  expect(in.empty(), "contents are too long");
  for (const auto type : unchanged) {
    expect(is_kept(type), "dynamic type " + std::to_string(type) + " is called unchanged");
    expect(!found.contains(type), "type " + std::to_string(type) + " is there and called unchanged");
  }
  for (const auto type : requested) {
    expect(type == 100004 || counted.contains(type) || !offered.contains(type), "not counted: " + std::to_string(type));
    if (is_kept(type) && !unchanged.contains(type)) forget(type);
  }
}

inline void StreamView::forget(std::uint32_t type) {
  if (type == 1) rate_hz = 0;
  if (type == 2) names.clear();
  if (type == 28) topologies.clear();
  if (type == 37) up = -1;
  if (type == 40) qualities.clear();
  if (type == 28001) scales.clear();
}

inline void StreamView::take_object(std::uint32_t type, Bytes in) {
  switch (type) {
    case 1: rate_hz = 135e6 / static_cast<double>(get<std::int64_t>(in)); break;
    case 2: take_subject(in); break;
    case 5: take_frame_id(get<std::uint32_t>(in)); break;
    case 8:
    case 9: {
      const auto subject = only_segment(in);
      const auto t = many<double, 3>(in);
      (type == 9 ? globals : locals)[subject] = {t, many<double, 9>(in)};
      break;
    }
    case 23:
      timecode.assign(reinterpret_cast<const char*>(in.data()), in.size());
      expect(in.size() == 17, "timecode is not 17 bytes");
      return;
    case 26: {
      latency.clear();
      for (auto n = get<std::uint32_t>(in); n > 0; --n) {
        const std::string name = text(in);
        latency.emplace_back(name, get<double>(in));
      }
      break;
    }
    case 28: {
      topologies.insert(only_segment(in));
      many<double, 12>(in);
      break;
    }
    case 36: hardware_number = get<std::uint32_t>(in); break;
    case 37: up = get<std::int8_t>(in); break;
    case 39: {
      rates.clear();
      for (auto n = get<std::uint32_t>(in); n > 0; --n) {
        const std::string name = text(in);
        rates[name] = get<double>(in);
      }
      break;
    }
    case 40: {
      const auto subject = get<std::uint32_t>(in);
      qualities[subject] = get<double>(in);
      break;
    }
    case 901: {
      const auto subject = only_segment(in);
      const auto t = many<float, 3>(in);
      lights[subject] = {t, many<float, 3>(in)};
      break;
    }
    case 28001: {
      scales.insert(only_segment(in));
      many<double, 3>(in);
      break;
    }
    default: return violated("unknown type " + std::to_string(type));
  }
  expect(in.empty(), "type " + std::to_string(type) + " is too long");
}

inline void StreamView::take_subject(Bytes& in) {
  const auto id = get<std::uint32_t>(in);
  const std::string name = text(in);
  expect(id != 0 && !names.contains(id), "subject id is 0 or doubled");
  expect(!name.empty(), "subject without a name");
  expect(get<std::uint32_t>(in) == 1, "subject has not one segment");
  expect(get<std::uint32_t>(in) == 0, "segment is not a root");
  expect(get<std::uint32_t>(in) == 1, "segment id is not 1");
  many<float, 6>(in);
  expect(text(in) == name, "segment is not called like its subject");
  expect(get<std::uint32_t>(in) == 0 && get<std::uint32_t>(in) == 0, "has markers");
  names[id] = name;
}

inline void StreamView::take_frame_id(std::uint32_t id) {
  expect(frames == 1 || id > frame_id, "frame number does not ascend");
  frame_id = id;
}

}  // namespace fiducap::vicon
