#include "stream_view.hpp"

namespace fiducap::vicon {

void StreamView::take_packet(Bytes in) {
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
    expect(objects.size() == 1 && objects[0].first == 100001,
           "does not begin with a greeting of its own");
    greeted = true;
    Bytes types = objects[0].second;
    const auto n = get<std::uint32_t>(types);
    for (std::uint32_t i = 0; i < n; ++i) offered.insert(get<std::uint32_t>(types));
    return expect(types.empty() && offered.size() == n, "greeting is malformed");
  }
  take_frame(objects);
}

void StreamView::take_frame(const std::vector<std::pair<std::uint32_t, Bytes>>& objects) {
  ++frames;
  expect(!requested.empty(), "comes before the client requested types");
  std::map<std::uint32_t, std::uint32_t> found;
  for (const auto& [type, bytes] : objects) ++found[type];
  expect(objects[0].first == 100004 && found[100004] == 1, "contents are not first and once");
  expect(found[5] == 1, "not one frame number");
  for (const auto& [type, n] : found)
    expect(requested.contains(type), "type " + std::to_string(type) + " not requested");
  if (requested.contains(26)) expect(found[26] == 1, "no latency");
  take_contents(objects[0].second, found);
  globals.clear();
  locals.clear();
  lights.clear();
  if (found[2] + found[1] > 0) ++frames_with_statics;
  for (const auto& [type, bytes] : objects) {
    if (type != 100004) take_object(type, bytes);
  }
  if (!requested.contains(2)) return;
  for (const auto& [id, pose] : globals) expect(names.contains(id), "pose of an unknown subject");
  for (const auto& [id, pose] : lights)
    expect(names.contains(id), "light pose of an unknown subject");
}

void StreamView::take_contents(Bytes in, const std::map<std::uint32_t, std::uint32_t>& found) {
  const auto n_counts = get<std::uint32_t>(in);
  std::set<std::uint32_t> counted;
  for (std::uint32_t i = 0; i < n_counts; ++i) {
    const auto type = get<std::uint32_t>(in);
    const auto n = get<std::uint32_t>(in);
    expect(counted.empty() || *counted.rbegin() < type, "contents do not ascend");
    counted.insert(type);
    const auto there = found.find(type);
    expect(n == (there == found.end() ? 0 : there->second),
           "wrong count of type " + std::to_string(type));
  }
  std::set<std::uint32_t> unchanged;
  const auto n_unchanged = get<std::uint32_t>(in);
  for (std::uint32_t i = 0; i < n_unchanged; ++i) unchanged.insert(get<std::uint32_t>(in));
  expect(in.empty(), "contents are too long");
  for (const auto type : unchanged) {
    expect(is_kept(type), "dynamic type " + std::to_string(type) + " is called unchanged");
    expect(!found.contains(type),
           "type " + std::to_string(type) + " is there and called unchanged");
  }
  for (const auto type : requested) {
    expect(type == 100004 || counted.contains(type) || !offered.contains(type),
           "not counted: " + std::to_string(type));
    if (is_kept(type) && !unchanged.contains(type)) forget(type);
  }
}

void StreamView::forget(std::uint32_t type) {
  if (type == 1) rate_hz = 0;
  if (type == 2) names.clear();
  if (type == 28) topologies.clear();
  if (type == 37) up = -1;
  if (type == 40) qualities.clear();
  if (type == 28001) scales.clear();
}

void StreamView::take_object(std::uint32_t type, Bytes in) {
  static const std::set<std::uint32_t> kKnown{1,  2,  5,  8,  9,  23,  26,
                                              28, 36, 37, 39, 40, 901, 28001};
  if (!kKnown.contains(type)) return violated("unknown type " + std::to_string(type));
  if (type == 1) rate_hz = 135e6 / static_cast<double>(get<std::int64_t>(in));
  if (type == 2) take_subject(in);
  if (type == 5) take_frame_id(get<std::uint32_t>(in));
  if (type == 8 || type == 9) {
    Pose& pose = (type == 9 ? globals : locals)[only_segment(in)];
    pose.t = many<double, 3>(in);
    pose.R = many<double, 9>(in);
  }
  if (type == 23) timecode = raw(in, 17);
  if (type == 26) latency = named_values(in);
  if (type == 28) topologies.insert(only_segment(in));
  if (type == 28) many<double, 12>(in);
  if (type == 36) hardware_number = get<std::uint32_t>(in);
  if (type == 37) up = get<std::int8_t>(in);
  if (type == 39) rates = named_values(in);
  if (type == 40) {
    const auto subject = get<std::uint32_t>(in);
    qualities[subject] = get<double>(in);
  }
  if (type == 901) {
    LightPose& pose = lights[only_segment(in)];
    pose.t = many<float, 3>(in);
    pose.r = many<float, 3>(in);
  }
  if (type == 28001) scales.insert(only_segment(in));
  if (type == 28001) many<double, 3>(in);
  expect(in.empty(), "type " + std::to_string(type) + " is too long");
}

void StreamView::take_subject(Bytes& in) {
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

void StreamView::take_frame_id(std::uint32_t id) {
  expect(frames == 1 || id > frame_id, "frame number does not ascend");
  frame_id = id;
}

}  // namespace fiducap::vicon
