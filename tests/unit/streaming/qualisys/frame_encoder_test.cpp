#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "base/bytes.hpp"
#include "streaming/conventions/protocol_conventions.hpp"
#include "streaming/qualisys/frame_board.hpp"
#include "support/allocation_counter.hpp"
#include "support/hex.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::qualisys {
namespace {

Components only(std::initializer_list<Component> list) {
  Components set;
  for (const Component c : list) set.add(c);
  return set;
}

std::vector<std::size_t> in_order(std::size_t n) {
  std::vector<std::size_t> rows(n);
  for (std::size_t i = 0; i < n; ++i) rows[i] = i;
  return rows;
}

EncodedFrame encode(const SceneFrame& frame, const Profile& profile, OutputAxes axes = kMillimetres,
                    WhenInvalid when_invalid = WhenInvalid::kFlag) {
  FrameEncoder encoder(axes, when_invalid);
  const auto rows = in_order(frame.bodies.size());
  encoder.begin(frame, rows.size(), rows);
  EncodedFrame out;
  encoder.encode(profile, out);
  return out;
}

/// One body at (1, -2, 0.25) m, turned by +90° about z; 1-sigma 10 mm.
std::shared_ptr<SceneFrame> known_frame() {
  auto frame = make_scene_frame({"alpha"}, 7);
  frame->at = instant_from_ns(1'500'000'000);
  frame->bodies[0].X_WP = {Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)),
                           {1.0, -2.0, 0.25}};
  return frame;
}

TEST(QualisysFrameEncoder, RotationMatrixGoesByColumnsInMillimetres) {
  const auto out = encode(*known_frame(), {only({Component::k6d}), std::endian::little, false});
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
  LittleEndianReader R(std::span(out.packet).subspan(header.size()));
  constexpr std::array<float, 9> kColumns{0, 1, 0, -1, 0, 0, 0, 0, 1};
  for (const float expected : kColumns) EXPECT_NEAR(R.f32(), expected, 1e-7F);
  EXPECT_EQ(out.datagram_ends, std::vector<std::size_t>{88});
  EXPECT_TRUE(out.split.empty());
}

TEST(QualisysFrameEncoder, EulerAnglesAreDegreesAndTheResidualIsOneSigma) {
  const auto out =
      encode(*known_frame(), {only({Component::k6dEulerRes}), std::endian::big, false});
  BigEndianReader in(out.packet);
  EXPECT_EQ(in.u32(), 24u + 16u + 28u);
  EXPECT_EQ(in.u32(), 3u);
  EXPECT_EQ(in.u64(), 1'500'000u);
  EXPECT_EQ(in.u32(), 7u);
  EXPECT_EQ(in.u32(), 1u);
  EXPECT_EQ(in.u32(), 44u);
  EXPECT_EQ(in.u32(), 12u);
  EXPECT_EQ(in.u32(), 1u);
  EXPECT_EQ(in.u32(), 0u);
  EXPECT_EQ(in.f32(), 1000.0F);
  EXPECT_EQ(in.f32(), -2000.0F);
  EXPECT_EQ(in.f32(), 250.0F);
  EXPECT_NEAR(in.f32(), 0.0F, 1e-5F);
  EXPECT_NEAR(in.f32(), 0.0F, 1e-5F);
  EXPECT_NEAR(in.f32(), 90.0F, 1e-4F);
  EXPECT_NEAR(in.f32(), 10.0F, 1e-4F);  // covariance 1e-4 m²
  EXPECT_EQ(in.left(), 0u);
}

TEST(QualisysFrameEncoder, BeforeVersion8CoordinatesAreDoubles) {
  const auto out = encode(*known_frame(), {only({Component::k6dRes}), std::endian::little, true});
  LittleEndianReader in(std::span(out.packet).subspan(24 + 16));
  EXPECT_EQ(in.left(), 104u);
  EXPECT_EQ(in.f64(), 1000.0);
  EXPECT_EQ(in.f64(), -2000.0);
  EXPECT_EQ(in.f64(), 250.0);
  for (int i = 0; i < 8; ++i) (void)in.f64();
  EXPECT_EQ(in.f64(), 1.0);  // R33
  EXPECT_NEAR(in.f32(), 10.0F, 1e-4F);
}

TEST(QualisysFrameEncoder, ABodyThatMayNotBeUsedIsAllBitsSet) {
  auto frame = make_scene_frame({"a", "b"});
  frame->bodies[0].valid = false;
  for (const bool wide : {false, true}) {
    for (const Component c :
         {Component::k6d, Component::k6dEuler, Component::k6dRes, Component::k6dEulerRes}) {
      const auto out = encode(*frame, {only({c}), std::endian::little, wide});
      const std::size_t body = (out.packet.size() - 40) / 2;
      for (std::size_t i = 0; i < body; ++i) EXPECT_EQ(out.packet[40 + i], std::byte{0xff});
      LittleEndianReader second(std::span(out.packet).subspan(40 + body));
      EXPECT_FALSE(std::isnan(wide ? second.f64() : second.f32()));
    }
  }
}

TEST(QualisysFrameEncoder, NumbersThatAreNoneAreNeverAPose) {
  auto frame = make_scene_frame({"a"});
  frame->bodies[0].X_WP.p.y() = std::numeric_limits<double>::infinity();
  const auto out = encode(*frame, {only({Component::k6d}), std::endian::little, false});
  LittleEndianReader in(std::span(out.packet).subspan(40));
  EXPECT_TRUE(std::isnan(in.f32()));
}

TEST(QualisysFrameEncoder, HoldKeepsTheLastPoseAndNothingElseDoes) {
  auto frame = make_scene_frame({"a"});
  const auto rows = in_order(1);
  for (const WhenInvalid policy : {WhenInvalid::kFlag, WhenInvalid::kStop, WhenInvalid::kHold}) {
    FrameEncoder encoder(kMillimetres, policy);
    frame->bodies[0].valid = true;
    encoder.begin(*frame, 1, rows);
    frame->bodies[0].valid = false;
    encoder.begin(*frame, 1, rows);
    EncodedFrame out;
    encoder.encode({only({Component::k6d}), std::endian::little, false}, out);
    LittleEndianReader in(std::span(out.packet).subspan(40));
    EXPECT_EQ(std::isnan(in.f32()), policy != WhenInvalid::kHold) << static_cast<int>(policy);
    frame->axes += 1;
    encoder.begin(*frame, 1, rows);
    encoder.encode({only({Component::k6d}), std::endian::little, false}, out);
    LittleEndianReader in_other_axes(std::span(out.packet).subspan(40));
    EXPECT_TRUE(std::isnan(in_other_axes.f32())) << static_cast<int>(policy);
  }
}

TEST(QualisysFrameEncoder, ABodyThatIsDisabledIsNotHeld) {
  auto frame = make_scene_frame({"a"});
  frame->bodies[0].valid = true;
  FrameEncoder encoder(kMillimetres, WhenInvalid::kHold);
  encoder.begin(*frame, 1, in_order(1));
  frame->bodies.clear();
  encoder.begin(*frame, 1, {});
  EncodedFrame out;
  encoder.encode({only({Component::k6d}), std::endian::little, false}, out);
  LittleEndianReader in(std::span(out.packet).subspan(40));
  EXPECT_TRUE(std::isnan(in.f32()));
}

TEST(QualisysFrameEncoder, ARowThatNoBodyFillsIsNan) {
  const auto frame = make_scene_frame({"b"});
  FrameEncoder encoder(kMillimetres, WhenInvalid::kFlag);
  encoder.begin(*frame, 2,
                std::vector<std::size_t>{1});  // row 0 belonged to a body that is disabled
  EncodedFrame out;
  encoder.encode({only({Component::k6d}), std::endian::little, false}, out);
  LittleEndianReader in(std::span(out.packet).subspan(32));
  EXPECT_EQ(in.u32(), 2u);
  (void)in.u32();
  EXPECT_TRUE(std::isnan(in.f32()));
  LittleEndianReader second(std::span(out.packet).subspan(40 + 48));
  EXPECT_EQ(second.f32(), 1000.0F);
}

TEST(QualisysFrameEncoder, ComponentsAscendAndThoseWithoutDataAreEmpty) {
  const auto out =
      encode(*known_frame(),
             {only({Component::kTimecode, Component::k3d, Component::kAnalog, Component::k6d}),
              std::endian::little, false});
  LittleEndianReader in(out.packet);
  (void)in.bytes(20);
  EXPECT_EQ(in.u32(), 4u);
  EXPECT_EQ(in.u32(), 16u);  // 3D: no marker, two rates
  EXPECT_EQ(in.u32(), 1u);
  EXPECT_EQ(in.u64(), 0u);
  EXPECT_EQ(in.u32(), 12u);  // analog: no device
  EXPECT_EQ(in.u32(), 3u);
  EXPECT_EQ(in.u32(), 0u);
  EXPECT_EQ(in.u32(), 64u);
  EXPECT_EQ(in.u32(), 5u);
  (void)in.bytes(56);
  EXPECT_EQ(in.u32(), 24u);
  EXPECT_EQ(in.u32(), 17u);
  EXPECT_EQ(in.u32(), 1u);
  EXPECT_EQ(in.u32(), 2u);  // camera time
  const std::uint64_t high = in.u32();
  EXPECT_EQ(high << 32 | in.u32(), 17'000'000'015'000'000u);  // 1 700 000 001.5 s in 100 ns
  EXPECT_EQ(in.left(), 0u);
}

TEST(QualisysFrameEncoder, AFrameTooLongForADatagramIsSplitIntoWholeComponents) {
  std::vector<std::string> names;
  for (int i = 0; i < 800; ++i) names.push_back("b" + std::to_string(i));
  const auto frame = make_scene_frame(names, 3);
  const auto out = encode(*frame, {Components::all(), std::endian::little, false});
  EXPECT_GT(out.packet.size(), kMaxDatagram);
  ASSERT_EQ(out.datagram_ends.size(), 4u);
  std::size_t begin = 0;
  for (const std::size_t end : out.datagram_ends) {
    EXPECT_LE(end - begin, kMaxDatagram);
    LittleEndianReader in(out.datagrams().subspan(begin, end - begin));
    EXPECT_EQ(in.u32(), end - begin);
    EXPECT_EQ(in.u32(), 3u);
    (void)in.u64();
    EXPECT_EQ(in.u32(), 3u);
    EXPECT_EQ(in.u32(), 1u);
    begin = end;
  }
}

TEST(QualisysFrameEncoder, AComponentTooLongForADatagramIsLeftOut) {
  std::vector<std::string> names(1400, "b");
  const auto out =
      encode(*make_scene_frame(names), {Components::all(), std::endian::little, false});
  ASSERT_EQ(out.datagram_ends.size(), 2u);  // the two with angles
  EXPECT_EQ(out.packet.size(), 24 + 4 * 16 + 1400 * (48 + 52 + 24 + 28));
}

// Clients decode the pose of the conventions, for any pose.
TEST(QualisysFrameEncoder, EveryPoseComesBackFromTheWire) {
  constexpr double kFloat_mm = 1e-3;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  auto frame = make_scene_frame({"a"});
  for (const UpAxis up : {UpAxis::kZ, UpAxis::kY}) {
    for (int i = 0; i < 200; ++i) {
      Pose& X = frame->bodies[0].X_WP;
      X.q = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                .normalized();
      X.p = {3 * normal(random), 3 * normal(random), normal(random)};
      const OutputAxes axes{up, AxesScope::kWorld, 1000.0};
      const Pose expected = AxesChange(axes).pose(X);
      const auto out = encode(
          *frame, {only({Component::k6d, Component::k6dEuler}), std::endian::little, false}, axes);
      LittleEndianReader in(std::span(out.packet).subspan(40));
      for (const double v : expected.p) EXPECT_NEAR(in.f32(), v, kFloat_mm);
      Eigen::Matrix3d R;
      for (double& v : R.reshaped()) v = in.f32();
      EXPECT_TRUE(R.isApprox(expected.q.toRotationMatrix(), 1e-6));
      (void)in.bytes(16 + 12);
      const double k = std::numbers::pi / 180;
      const double a1 = in.f32() * k;
      const double a2 = in.f32() * k;
      const double a3 = in.f32() * k;
      const Eigen::Quaterniond q = Eigen::AngleAxisd(a1, Eigen::Vector3d::UnitX()) *
                                   Eigen::AngleAxisd(a2, Eigen::Vector3d::UnitY()) *
                                   Eigen::AngleAxisd(a3, Eigen::Vector3d::UnitZ());
      EXPECT_LT(q.angularDistance(expected.q), 1e-5);
    }
  }
}

TEST(QualisysFrameEncoder, AllocatesNothingAfterTheFirstFrame) {
  const auto frame = make_scene_frame({"a", "b", "c"});
  FrameEncoder encoder(kMillimetres, WhenInvalid::kFlag);
  const auto rows = in_order(3);
  const Profile profile{Components::all(), std::endian::little, false};
  EncodedFrame out;
  encoder.begin(*frame, 3, rows);
  encoder.encode(profile, out);
  const AllocationCounter counter;
  for (int i = 0; i < 100; ++i) {
    encoder.begin(*frame, 3, rows);
    encoder.encode(profile, out);
  }
  EXPECT_EQ(counter.count(), 0u);
}

constexpr double kRounding = 1e-7;  // near ±90° the arc sine loses half of the digits

/// As libmotioncapture rebuilds it.
Eigen::Matrix3d rebuilt(const Eigen::Vector3d& deg) {
  const Eigen::Vector3d a = deg * std::numbers::pi / 180.0;
  return (Eigen::AngleAxisd(a.x(), Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(a.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(a.z(), Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

TEST(QualisysEuler, AnglesRebuildEveryRotation) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Quaterniond q =
        Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
            .normalized();
    const Eigen::Matrix3d R = q.toRotationMatrix();
    EXPECT_TRUE(rebuilt(euler_deg(R)).isApprox(R, kRounding));
  }
}

TEST(QualisysEuler, AnglesRebuildTheRotationsWhereTwoAxesFallTogether) {
  for (const double a2 : {90.0, -90.0}) {
    for (const double a1 : {0.0, 30.0, -120.0, 180.0}) {
      for (const double a3 : {0.0, 45.0, -170.0}) {
        const Eigen::Matrix3d R = rebuilt({a1, a2, a3});
        const Eigen::Vector3d found = euler_deg(R);
        EXPECT_TRUE(found.allFinite());
        EXPECT_TRUE(rebuilt(found).isApprox(R, kRounding)) << a1 << ' ' << a2 << ' ' << a3;
      }
    }
  }
}

TEST(QualisysEuler, EachAngleTurnsAboutItsOwnAxis) {
  const Eigen::Vector3d angles(10, -20, 30);
  EXPECT_TRUE(euler_deg(rebuilt(angles)).isApprox(angles, kRounding));
}

}  // namespace
}  // namespace fiducap::qualisys
