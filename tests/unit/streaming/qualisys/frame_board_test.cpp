#include "streaming/qualisys/frame_board.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include <Eigen/Geometry>

#include "base/bytes.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::qualisys {
namespace {

using testing::ElementsAre;
using ComponentList = std::initializer_list<Component>;

constexpr std::size_t kPoses = 40;  // offset of the first body of the first component
const Profile kAllComponents{Components::all(), std::endian::little, false};

Profile profile_of(ComponentList list, std::endian order = std::endian::little, bool wide = false) {
  Profile profile{{}, order, wide};
  for (const Component c : list) profile.components.add(c);
  return profile;
}

std::vector<std::size_t> in_order(std::size_t n) {
  std::vector<std::size_t> rows(n);
  std::iota(rows.begin(), rows.end(), std::size_t{0});
  return rows;
}

EncodedFrame encode(const SceneFrame& frame, const Profile& profile,
                    const OutputAxes& axes = kMillimetres) {
  FrameEncoder encoder(axes, WhenInvalid::kFlag);
  const auto rows = in_order(frame.bodies.size());
  encoder.begin(frame, rows.size(), rows);
  EncodedFrame out;
  encoder.encode(profile, out);
  return out;
}

EncodedFrame pose_of(const FrameEncoder& encoder) {
  EncodedFrame out;
  encoder.encode(profile_of({Component::k6d}), out);
  return out;
}

LittleEndianReader reader(const EncodedFrame& out, std::size_t at = kPoses) {
  return LittleEndianReader(std::span(out.packet).subspan(at));
}

bool first_pose_is_nan(const EncodedFrame& out) { return std::isnan(reader(out).f32()); }

template <class Reader>
void expect_words(Reader& in, std::initializer_list<std::uint32_t> words) {
  for (const std::uint32_t word : words) EXPECT_EQ(in.u32(), word);
}

std::shared_ptr<SceneFrame> many_bodies(int n, std::uint64_t number = 1) {
  return make_scene_frame(std::vector<std::string>(static_cast<std::size_t>(n), "b"), number);
}

/// One body at (1, -2, 0.25) m, turned by +90° about z; 1-sigma 10 mm.
std::shared_ptr<SceneFrame> known_frame() {
  auto frame = make_scene_frame({"alpha"}, 7);
  frame->at = instant_from_ns(1'500'000'000);
  frame->bodies[0].X_WP = {Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)),
                           {1.0, -2.0, 0.25}};
  return frame;
}

TEST(QualisysFrameEncoder, EncodesTheRotationMatrixByColumnsInMillimetres) {
  const auto out = encode(*known_frame(), profile_of({Component::k6d}));
  const auto header = from_hex(
      "58000000 03000000"           // 88 bytes, data
      "60e3160000000000"            // 1 500 000 µs
      "07000000 01000000"           // frame 7, one component
      "40000000 05000000"           // 64 bytes, 6D
      "01000000 0000 0000"          // one body, no drops
      "00007a44 0000fac4 00007a43"  // 1000, -2000, 250 mm
  );
  ASSERT_EQ(out.packet.size(), 88u);
  EXPECT_TRUE(std::equal(header.begin(), header.end(), out.packet.begin()));
  // cos sin 0 / -sin cos 0 / 0 0 1: the first column is where the body's x axis points, world y.
  auto R = reader(out, header.size());
  for (const float expected : {0.F, 1.F, 0.F, -1.F, 0.F, 0.F, 0.F, 0.F, 1.F})
    EXPECT_NEAR(R.f32(), expected, 1e-7F);
  EXPECT_EQ(out.datagram_ends, std::vector<std::size_t>{88});
  EXPECT_TRUE(out.split.empty());
}

TEST(QualisysFrameEncoder, EncodesEulerAnglesInDegreesAndOneSigmaAsResidual) {
  const auto out = encode(*known_frame(), profile_of({Component::k6dEulerRes}, std::endian::big));
  BigEndianReader in(out.packet);
  expect_words(in, {24 + 16 + 28, 3});
  EXPECT_EQ(in.u64(), 1'500'000u);
  expect_words(in, {7, 1, 44, 12, 1, 0});
  for (const float p_mm : {1000.0F, -2000.0F, 250.0F}) EXPECT_EQ(in.f32(), p_mm);
  EXPECT_NEAR(in.f32(), 0.0F, 1e-5F);
  EXPECT_NEAR(in.f32(), 0.0F, 1e-5F);
  EXPECT_NEAR(in.f32(), 90.0F, 1e-4F);
  EXPECT_NEAR(in.f32(), 10.0F, 1e-4F);  // covariance 1e-4 m²
  EXPECT_EQ(in.left(), 0u);
}

TEST(QualisysFrameEncoder, EncodesDoublesBeforeVersion8) {
  const auto out =
      encode(*known_frame(), profile_of({Component::k6dRes}, std::endian::little, true));
  auto in = reader(out);
  EXPECT_EQ(in.left(), 104u);
  for (const double p_mm : {1000.0, -2000.0, 250.0}) EXPECT_EQ(in.f64(), p_mm);
  for (int i = 0; i < 8; ++i) (void)in.f64();
  EXPECT_EQ(in.f64(), 1.0);  // R33
  EXPECT_NEAR(in.f32(), 10.0F, 1e-4F);
}

TEST(QualisysFrameEncoder, SetsAllBitsOfInvalidAndNonFinitePoses) {
  auto frame = make_scene_frame({"a", "b"});
  frame->bodies[0].valid = false;
  for (const bool wide : {false, true}) {
    for (const Component c :
         {Component::k6d, Component::k6dEuler, Component::k6dRes, Component::k6dEulerRes}) {
      const auto out = encode(*frame, profile_of({c}, std::endian::little, wide));
      const std::size_t body = (out.packet.size() - kPoses) / 2;
      for (std::size_t i = 0; i < body; ++i) EXPECT_EQ(out.packet[kPoses + i], std::byte{0xff});
      auto second = reader(out, kPoses + body);
      EXPECT_FALSE(std::isnan(wide ? second.f64() : second.f32()));
    }
  }
  frame->bodies[0].valid = true;
  frame->bodies[0].X_WP.p.y() = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(first_pose_is_nan(encode(*frame, profile_of({Component::k6d}))));
}

TEST(QualisysFrameEncoder, RepeatsTheLastPoseOnlyWithHoldAndInTheSameAxes) {
  auto frame = make_scene_frame({"a"});
  const auto rows = in_order(1);
  for (const WhenInvalid policy : {WhenInvalid::kFlag, WhenInvalid::kStop, WhenInvalid::kHold}) {
    FrameEncoder encoder(kMillimetres, policy);
    frame->bodies[0].valid = true;
    encoder.begin(*frame, 1, rows);
    frame->bodies[0].valid = false;
    encoder.begin(*frame, 1, rows);
    EXPECT_EQ(first_pose_is_nan(pose_of(encoder)), policy != WhenInvalid::kHold)
        << static_cast<int>(policy);
    frame->axes += 1;
    encoder.begin(*frame, 1, rows);
    EXPECT_TRUE(first_pose_is_nan(pose_of(encoder))) << static_cast<int>(policy);
  }
}

TEST(QualisysFrameEncoder, EncodesRowsOfDisabledBodiesAsNan) {
  auto frame = make_scene_frame({"a"});
  FrameEncoder encoder(kMillimetres, WhenInvalid::kHold);
  encoder.begin(*frame, 1, in_order(1));
  frame->bodies.clear();
  encoder.begin(*frame, 1, {});
  EXPECT_TRUE(first_pose_is_nan(pose_of(encoder))) << "not even held";
  FrameEncoder two(kMillimetres, WhenInvalid::kFlag);
  two.begin(*make_scene_frame({"b"}), 2, std::vector<std::size_t>{1});
  const auto out = pose_of(two);
  EXPECT_EQ(reader(out, 32).u32(), 2u);
  EXPECT_TRUE(first_pose_is_nan(out));
  EXPECT_EQ(reader(out, kPoses + 48).f32(), 1000.0F);
}

TEST(QualisysFrameEncoder, OrdersComponentsAndLeavesThoseWithoutDataEmpty) {
  const auto out = encode(*known_frame(), profile_of({Component::kTimecode, Component::k3d,
                                                      Component::kAnalog, Component::k6d}));
  auto in = reader(out, 20);
  expect_words(in, {4, 16, 1});  // 3D: no marker,
  EXPECT_EQ(in.u64(), 0u);       // two rates
  expect_words(in, {12, 3, 0});  // analog: no device
  expect_words(in, {64, 5});
  (void)in.bytes(56);
  expect_words(in, {24, 17, 1, 2});  // camera time
  const std::uint64_t high = in.u32();
  EXPECT_EQ(high << 32 | in.u32(), 17'000'000'015'000'000u);  // 1 700 000 001.5 s in 100 ns
  EXPECT_EQ(in.left(), 0u);
}

TEST(QualisysFrameEncoder, SplitsLongFramesAndOmitsComponentsTooLongForADatagram) {
  const auto out = encode(*many_bodies(800, 3), kAllComponents);
  EXPECT_GT(out.packet.size(), kMaxDatagram);
  ASSERT_EQ(out.datagram_ends.size(), 4u);
  std::size_t begin = 0;
  for (const std::size_t end : out.datagram_ends) {
    EXPECT_LE(end - begin, kMaxDatagram);
    LittleEndianReader in(out.datagrams().subspan(begin, end - begin));
    EXPECT_EQ(in.u32(), end - begin);
    EXPECT_EQ(in.u32(), 3u);
    (void)in.u64();
    expect_words(in, {3, 1});
    begin = end;
  }
  const auto longest = encode(*many_bodies(1400), kAllComponents);
  ASSERT_EQ(longest.datagram_ends.size(), 2u);  // the two with angles
  EXPECT_EQ(longest.packet.size(), 24 + 4 * 16 + 1400 * (48 + 52 + 24 + 28));
}

/// As libmotioncapture rebuilds it.
Eigen::Matrix3d rebuilt(const Eigen::Vector3d& deg) {
  const Eigen::Vector3d a = deg * std::numbers::pi / 180.0;
  return (Eigen::AngleAxisd(a.x(), Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(a.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(a.z(), Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

Eigen::Quaterniond random_attitude(std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::Quaterniond q;
  for (double& part : q.coeffs()) part = normal(random);
  return q.normalized();
}

TEST(QualisysFrameEncoder, ClientsDecodeAnyPoseInTheConfiguredAxes) {
  constexpr double kFloat_mm = 1e-3;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  auto frame = make_scene_frame({"a"});
  for (const UpAxis up : {UpAxis::kZ, UpAxis::kY}) {
    for (int i = 0; i < 200; ++i) {
      Pose& X = frame->bodies[0].X_WP;
      X.q = random_attitude(random);
      X.p = {3 * normal(random), 3 * normal(random), normal(random)};
      const OutputAxes axes{up, AxesScope::kWorld, 1000.0};
      const Pose expected = AxesChange(axes).pose(X);
      const auto out = encode(*frame, profile_of({Component::k6d, Component::k6dEuler}), axes);
      auto in = reader(out);
      for (const double v : expected.p) EXPECT_NEAR(in.f32(), v, kFloat_mm);
      Eigen::Matrix3d R;
      for (double& v : std::span(R.data(), 9)) v = in.f32();
      EXPECT_TRUE(R.isApprox(expected.q.toRotationMatrix(), 1e-6));
      (void)in.bytes(16 + 12);
      Eigen::Vector3d euler;
      for (double& v : euler) v = in.f32();
      const Eigen::Quaterniond q(rebuilt(euler));
      EXPECT_LT(q.angularDistance(expected.q), 1e-5);
    }
  }
}

constexpr double kRounding = 1e-7;  // near ±90° the arc sine loses half of the digits

TEST(QualisysEuler, AnglesRebuildEveryRotation) {
  std::mt19937 random(7);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Matrix3d R = random_attitude(random).toRotationMatrix();
    EXPECT_TRUE(rebuilt(euler_deg(R)).isApprox(R, kRounding));
  }
  for (const double a2 : {90.0, -90.0}) {  // two axes coincide
    for (const double a1 : {0.0, 30.0, -120.0, 180.0}) {
      for (const double a3 : {0.0, 45.0, -170.0}) {
        const Eigen::Matrix3d R = rebuilt({a1, a2, a3});
        const Eigen::Vector3d found = euler_deg(R);
        EXPECT_TRUE(found.allFinite());
        EXPECT_TRUE(rebuilt(found).isApprox(R, kRounding)) << a1 << ' ' << a2 << ' ' << a3;
      }
    }
  }
  const Eigen::Vector3d angles(10, -20, 30);
  EXPECT_TRUE(euler_deg(rebuilt(angles)).isApprox(angles, kRounding)) << "each about its own axis";
}

SceneModel model_of(std::uint64_t generation, std::vector<BodyDescription> bodies) {
  SceneModel model;
  model.generation = generation;
  model.bodies = std::move(bodies);
  return model;
}

class QualisysBodyTable : public testing::Test {
 protected:
  QualisysBodyTable() { table_.update(model_of(1, {{1, "arm"}, {2, "drone"}})); }
  std::vector<std::string> names() const {
    std::vector<std::string> all;
    for (const auto& entry : table_.entries()) all.push_back(entry.name);
    return all;
  }
  BodyTable table_;
};

TEST_F(QualisysBodyTable, ShowsAnAlias) {
  table_ = BodyTable(NameAliases{{"drone", "cf <7>"}});
  EXPECT_TRUE(table_.update(model_of(1, {{1, "arm"}, {2, "drone"}})));
  EXPECT_THAT(names(), ElementsAre("arm", "cf _7_"));
}

TEST_F(QualisysBodyTable, KeepsThePlaceOfADisabledBody) {
  EXPECT_THAT(names(), ElementsAre("arm", "drone"));
  EXPECT_THAT(table_.index_of_body(), ElementsAre(0, 1));
  EXPECT_FALSE(table_.update(model_of(1, {{1, "arm"}}))) << "the same generation";
  EXPECT_TRUE(table_.update(model_of(2, {{2, "drone"}})));
  ASSERT_EQ(table_.entries().size(), 2u);
  EXPECT_FALSE(table_.entries()[0].enabled);
  EXPECT_THAT(table_.index_of_body(), ElementsAre(1));
  table_.update(model_of(3, {{1, "arm"}, {2, "drone"}}));
  EXPECT_TRUE(table_.entries()[0].enabled);
  EXPECT_THAT(table_.index_of_body(), ElementsAre(0, 1));
}

TEST_F(QualisysBodyTable, KeepsThePlaceOfARenamedBodyAndAppendsOthers) {
  table_.update(model_of(2, {{3, "rover"}, {1, "left arm"}, {2, "drone"}}));
  EXPECT_THAT(names(), ElementsAre("left arm", "drone", "rover"));
  EXPECT_THAT(table_.index_of_body(), ElementsAre(2, 0, 1));
}

class QualisysFrameBoard : public testing::Test {
 protected:
  void put(std::uint64_t number) {
    const auto frame = make_scene_frame({"a"}, number);
    bodies_.update(*frame->model);
    board_.put(frame, bodies_);
  }
  BodyTable bodies_;
  FrameBoard board_{QualisysConfig{}};
  Profile profile_{Components::all(), std::endian::little, false};
};

TEST_F(QualisysFrameBoard, EncodesEachFrameOncePerProfile) {
  EXPECT_EQ(board_.number(), 0u);
  put(1);
  const auto first = board_.encoded(profile_);
  EXPECT_EQ(board_.encoded(profile_), first);
  Profile other = profile_;
  other.order = std::endian::big;
  EXPECT_NE(board_.encoded(other), first);
  EXPECT_EQ(board_.encoded(profile_), first);
  put(2);
  EXPECT_NE(board_.encoded(profile_)->packet, first->packet);
}

}  // namespace
}  // namespace fiducap::qualisys
