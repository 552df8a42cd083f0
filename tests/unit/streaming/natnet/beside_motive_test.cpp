// Recorded messages of a commercial server and our replies to the same requests, field by field.
// The table in docs/natnet-clients.md lists the intended differences.
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "base/bytes.hpp"
#include "conversation_fixture.hpp"
#include "support/shared_data.hpp"

namespace fiducap::natnet {
namespace {

using testing::ElementsAreArray;

constexpr std::uint16_t kCommandPort = 1510;
constexpr std::uint16_t kDataPort = 1511;
constexpr double kFloat = 1e-6;       // relative, of a float32
constexpr std::int32_t kMost = 1000;  // of the items of a list

struct WireField {
  std::string name;  ///< E.g. `body.mean_error`
  double value{};    ///< Of a text its length.
};

struct WireFrame {
  std::vector<WireField> fields;
  std::vector<std::vector<WireField>> bodies;

  /// The first of this name.
  [[nodiscard]] std::optional<double> operator[](const std::string& name) const {
    const auto found = std::ranges::find(fields, name, &WireField::name);
    return found == fields.end() ? std::nullopt : std::optional(found->value);
  }
  /// The names in their order, each once.
  [[nodiscard]] std::vector<std::string> structure() const {
    std::vector<std::string> names;
    auto all = fields;
    if (!bodies.empty()) all.insert(all.end(), bodies[0].begin(), bodies[0].end());
    for (const WireField& field : all) {
      if (std::ranges::find(names, field.name) == names.end()) names.push_back(field.name);
    }
    return names;
  }
};

/// Decodes a frame of any NatNet server field by field.
class WireFields final {
 public:
  WireFields(std::span<const std::byte> frame, Bitstream version)
      : in_(frame), version_(version), into_(&frame_.fields) {}

  /// @return nullopt: the frame does not end with its last field
  std::optional<WireFrame> all() {
    in_.bytes(kHeaderSize);
    note("frame", in_.i32());
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
  [[nodiscard]] bool since(std::uint8_t major, std::uint8_t minor) const {
    return version_ >= Bitstream{major, minor};
  }
  template <typename Number>
  void note(const std::string& name, Number value) {
    into_->push_back({name, static_cast<double>(value)});
  }
  void vector(const std::string& name) {
    for (const char* axis : {".x", ".y", ".z"}) note(name + axis, in_.f32());
  }
  void text(const std::string& name) {
    int length = 0;
    while (!in_.failed() && in_.u8() != 0) ++length;
    note(name, length);
  }
  template <typename Item>
  void list(const std::string& name, Item item) {
    const std::int32_t n = in_.i32();
    note(name, n);
    broken_ = broken_ || n < 0 || n > kMost;
    for (std::int32_t i = 0; i < n && !broken_ && !in_.failed(); ++i) item();
  }
  void body() {
    into_ = &frame_.bodies.emplace_back();
    note("body.id", in_.i32());
    vector("body.p");
    for (const char* part : {"body.qx", "body.qy", "body.qz", "body.qw"}) note(part, in_.f32());
    if (!since(3, 0)) list("body.markers", [this] { in_.bytes(12 + 4 + 4); });  // p, id, size
    note("body.mean_error", in_.f32());
    if (since(2, 6)) note("body.params", in_.i16());
    into_ = &frame_.fields;
  }
  void labeled_marker() {
    note("labeled.id", in_.i32());
    vector("labeled.p");
    note("labeled.size", in_.f32());
    if (since(2, 6)) note("labeled.params", in_.i16());
    if (since(3, 0)) note("labeled.residual", in_.f32());
  }
  void suffix() {
    if (!since(3, 0)) note("latency", in_.f32());
    note("timecode", in_.i32());
    note("timecode_sub", in_.i32());
    if (since(2, 7)) note("timestamp", in_.f64());
    if (version_ == Bitstream{2, 6}) note("timestamp", in_.f32());
    if (since(3, 0)) {
      for (const char* stamp : {"mid_exposure", "data_received", "transmit"})
        note(stamp, in_.u64());
    }
    if (since(2, 6)) note("params", in_.i16());
    note("end", in_.i32());
  }

  LittleEndianReader in_;
  Bitstream version_;
  WireFrame frame_;
  std::vector<WireField>* into_;
  bool broken_{false};
};

std::optional<WireFrame> take_apart(std::span<const std::byte> frame, Bitstream version) {
  return WireFields(frame, version).all();
}

Bytes read_bytes(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

struct CapturedDatagram {
  Bytes bytes;
  std::uint16_t from_port{}, to_port{};
};

/// @return nullopt: not UDP in IPv4
std::optional<CapturedDatagram> datagram_in(std::span<const std::byte> packet) {
  constexpr std::size_t kEthernet = 14;
  const auto u16 = [](std::span<const std::byte> bytes) { return BigEndianReader(bytes).u16(); };
  if (packet.size() < kEthernet + 20 || u16(packet.subspan(12)) != 0x0800) return std::nullopt;
  const auto ip = packet.subspan(kEthernet);
  const std::size_t header = (std::to_integer<std::size_t>(ip[0]) & 15U) * 4;
  if (ip[9] != std::byte{17} || ip.size() < header + 8) return std::nullopt;
  const auto udp = ip.subspan(header);
  const std::size_t length = u16(udp.subspan(4));
  if (length < 8 || length > udp.size()) return std::nullopt;
  const auto payload = udp.first(length).subspan(8);
  return CapturedDatagram{{payload.begin(), payload.end()}, u16(udp), u16(udp.subspan(2))};
}

/// UDP payloads of a pcapng file (Ethernet, IPv4), in order.
std::vector<CapturedDatagram> read_capture(const std::string& file) {
  constexpr std::uint32_t kEnhancedPacket = 6;
  const Bytes bytes = read_bytes(file);
  const auto u32 = [&](std::size_t at) {
    return LittleEndianReader(std::span(bytes).subspan(std::min(at, bytes.size()))).u32();
  };
  std::vector<CapturedDatagram> all;
  for (std::size_t at = 0; at + 12 <= bytes.size();) {
    const std::size_t length = u32(at + 4);
    if (length < 12 || length > bytes.size() - at) break;
    const std::size_t captured = u32(at + 20);
    if (u32(at) == kEnhancedPacket && length >= 32 && captured <= length - 32) {
      auto datagram = datagram_in(std::span(bytes).subspan(at + 28, captured));
      if (datagram) all.push_back(std::move(*datagram));
    }
    at += length;
  }
  return all;
}

/// Our server with one body of the recorded name and number.
class BesideMotive : public ConversationFixture {
 protected:
  void SetUp() override {
    const auto data = shared_data();
    if (!data) GTEST_SKIP() << kNoSharedData;
    folder_ = (*data / "wire").string();
    ConversationFixture::SetUp();
    auto frame = race_quad(Pose{});
    frame->model = std::make_shared<SceneModel>(SceneModel{2, {{2, "RaceQuad"}}});
    frame->at = frame->published_at = now_;
    frame->rate_hz = 120;
    conversation_->take(frame, now_);
    now_ += Conversation::kAnnounce;  // the model is announced
    conversation_->take(frame, now_);
  }
  static std::shared_ptr<SceneFrame> race_quad(const Pose& X_WP) {
    auto frame = make_scene_frame({"RaceQuad"}, 162734);
    frame->bodies[0].body_id = 2;
    frame->bodies[0].X_WP = X_WP;
    return frame;
  }
  [[nodiscard]] Bytes ours_at(Bitstream version) {
    config_.bitstream = text_of(version);
    SetUp();
    const auto frame = conversation_->multicast_frame(now_);
    return {frame.begin(), frame.end()};
  }
  [[nodiscard]] std::string packet(const std::string& name) const {
    return folder_ + "/natnet_python_natnet/test_data/" + name;
  }

  std::string folder_;
};

std::vector<std::string> without_markers(std::vector<std::string> names) {
  std::erase_if(names, [](const std::string& name) {
    return name.starts_with("marker_set.") || name.starts_with("other_marker.") ||
           name.starts_with("labeled.");
  });
  return names;
}

TEST_F(BesideMotive, EveryRecordedFrameHasTheStructureOfOurs) {
  int frames = 0;
  double last = 0;
  const auto ours = take_apart(ours_at({3, 0}), {3, 0});
  ASSERT_TRUE(ours);
  for (const auto& datagram : read_capture(packet("raw/traffic.pcapng"))) {
    if (id_of(datagram.bytes) != Message::kFrame) continue;
    EXPECT_EQ(datagram.from_port, kDataPort);
    EXPECT_EQ(datagram.to_port, kDataPort);
    const auto theirs = take_apart(datagram.bytes, {3, 0});
    ASSERT_TRUE(theirs);
    ASSERT_THAT(ours->structure(), ElementsAreArray(without_markers(theirs->structure())));
    if (frames > 0) {
      EXPECT_EQ((*theirs)["frame"], last + 1);
    }
    last = *(*theirs)["frame"];
    for (const char* zero : {"timecode", "timecode_sub", "params", "end", "skeletons"}) {
      EXPECT_EQ((*theirs)[zero], 0) << zero;
      EXPECT_EQ((*ours)[zero], 0) << zero;
    }
    EXPECT_LE((*theirs)["mid_exposure"], (*theirs)["data_received"]);
    EXPECT_LE((*theirs)["data_received"], (*theirs)["transmit"]);
    ++frames;
  }
  EXPECT_EQ(frames, 518);
}

TEST_F(BesideMotive, FramesOfOlderVersionsHaveTheFieldsOfOurs) {
  const std::pair<const char*, Bitstream> kVersions[] = {
      {"1.5.0", {2, 5}}, {"1.7.2", {2, 7}}, {"1.9.0", {2, 9}}};
  for (const auto& [motive, version] : kVersions) {
    for (const char* number : {"001", "002"}) {
      const auto theirs =
          take_apart(read_bytes(folder_ + "/natnet_natnet-decode/tests/data/frame-motive-" +
                                motive + "-" + number + ".bin"),
                     version);
      ASSERT_TRUE(theirs) << motive;
      const auto ours = take_apart(ours_at(version), version);
      ASSERT_TRUE(ours) << motive;
      EXPECT_THAT(ours->structure(), ElementsAreArray(without_markers(theirs->structure())));
      ASSERT_EQ(theirs->bodies.size(), 1U);
      EXPECT_EQ(theirs->bodies[0].size(), ours->bodies.at(0).size());
      // Its latency is the time stamp once more, as a float.
      if (const auto stamp = (*theirs)["timestamp"]) {
        EXPECT_NEAR(*(*theirs)["latency"], *stamp, 1e-6 * *stamp) << motive;
      }
    }
  }
}

TEST_F(BesideMotive, ABodyInTheSamePoseHasTheSameValues) {
  const auto theirs = read_bytes(packet("mocapframe_packet_v3.bin"));
  const auto read = take_apart(theirs, {3, 0});
  ASSERT_TRUE(read);
  const auto& body = read->bodies.at(0);
  const auto at = [&](std::size_t i) { return body.at(i).value; };
  // Their y-up axes to ours: x east, y north is their -z, z up is their y.
  const Eigen::Quaterniond q(at(7), at(4), -at(6), at(5));
  auto frame = race_quad({q.normalized(), {at(1), -at(3), at(2)}});
  frame->bodies[0].covariance = Matrix12d::Identity() * (at(8) * at(8));
  conversation_->take(frame, now_);
  const auto bytes = conversation_->multicast_frame(now_);
  const auto ours = take_apart(bytes, {3, 0});
  ASSERT_TRUE(ours);
  ASSERT_EQ(ours->bodies.at(0).size(), body.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    if (body[i].name == "body.mean_error") continue;  // ours is made of three axes
    EXPECT_NEAR(ours->bodies[0][i].value, body[i].value, kFloat * std::abs(body[i].value) + kFloat)
        << body[i].name;
  }
  EXPECT_EQ((*ours)["frame"], (*read)["frame"]);
}

TEST_F(BesideMotive, EveryRecordedRequestGetsTheSameKindOfAnswer) {
  const auto session = read_capture(packet("raw/traffic.pcapng"));
  std::vector<CapturedDatagram> asked;
  int compared = 0;
  for (const auto& datagram : session) {
    if (datagram.to_port == kCommandPort) asked.push_back(datagram);
    if (datagram.from_port != kCommandPort || asked.empty()) continue;
    const auto question = std::find_if(asked.begin(), asked.end(), [&](const auto& one) {
      const auto kind = [](Message m) { return static_cast<int>(m); };
      const int q = kind(id_of(one.bytes));
      const int a = kind(id_of(datagram.bytes));
      return a == q + 1 || (q == kind(Message::kDiscovery) && a == 1) ||
             (q == kind(Message::kRequest) && a == 100);
    });
    ASSERT_NE(question, asked.end()) << static_cast<int>(id_of(datagram.bytes));
    const bool library_check = text_in(question->bytes).rfind("service20", 0) == 0;
    const auto ours = say_to_group(question->bytes);
    ASSERT_GE(ours.size(), kHeaderSize);
    if (!library_check) {
      EXPECT_EQ(id_of(ours), id_of(datagram.bytes)) << text_in(question->bytes);
      const bool same_size =
          id_of(ours) != Message::kModel && id_of(ours) != Message::kUnrecognized;
      if (same_size) {
        EXPECT_EQ(ours.size(), datagram.bytes.size());
      }
      ++compared;
    }
    asked.erase(question);
  }
  EXPECT_EQ(compared, 15);
}

TEST_F(BesideMotive, ServerInfoDiffersOnlyInNameAndVersion) {
  const auto theirs = read_bytes(packet("serverinfo_packet_v3.bin"));
  const auto ours = say_to_group(read_bytes(packet("connect_packet_v3.bin")));
  ASSERT_EQ(ours.size(), theirs.size());
  EXPECT_TRUE(std::equal(theirs.begin(), theirs.begin() + kHeaderSize, ours.begin()));
  constexpr std::size_t kNatNetMajor = kHeaderSize + 260;
  EXPECT_EQ(ours[kNatNetMajor], theirs[kNatNetMajor]);
  constexpr std::size_t kDataPortAndGroup = kHeaderSize + 272;
  EXPECT_TRUE(std::equal(theirs.begin() + kDataPortAndGroup, theirs.end(),
                         ours.begin() + kDataPortAndGroup))
      << "port 1511, multicast, 239.255.42.99";
}

TEST_F(BesideMotive, ModelDescribesTheBodyEquallyWithoutMarkers) {
  const auto theirs = read_bytes(packet("modeldef_packet_v3.bin"));
  const auto ours = say_to_group(read_bytes(packet("requestmodeldef_packet_v3.bin")));
  constexpr std::size_t kCount = kHeaderSize;
  constexpr std::size_t kBody = kHeaderSize + 4;
  constexpr std::size_t kUpToMarkers = 4 + 9 + 4 + 4 + 12;  // type, "RaceQuad", id, parent, offset
  ASSERT_EQ(ours.size(), kBody + kUpToMarkers + 4);
  EXPECT_EQ(ours[kCount], std::byte{1});
  EXPECT_EQ(theirs[kCount], std::byte{3}) << "the body, and two sets of its markers";
  EXPECT_TRUE(std::equal(ours.begin() + kBody, ours.begin() + kBody + kUpToMarkers,
                         theirs.begin() + kBody));
}

}  // namespace
}  // namespace fiducap::natnet
