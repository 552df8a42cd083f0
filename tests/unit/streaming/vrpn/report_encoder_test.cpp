#include <gmock/gmock.h>

#include <limits>
#include <numbers>

#include "base/pose.hpp"
#include "connection_fixture.hpp"
#include "streaming/vrpn/codec.hpp"
#include "support/allocation_counter.hpp"
#include "support/scene_builder.hpp"

namespace fiducap::vrpn {
namespace {

// Values travel as doubles; a few roundings of products.
constexpr double kRounding = 1e-12;

struct Report {
  Header header;
  std::int32_t sensor{};
  Eigen::Vector3d vector;
  Eigen::Quaterniond quaternion;
  double dt_s{};
};

std::vector<Report> decoded(const EncodedFrame& frame) {
  std::vector<Report> reports;
  for (const auto& [header, payload] : split(frame.bytes)) {
    BigEndianReader in(payload);
    Report report;
    report.header = header;
    report.sensor = in.i32();
    in.i32();
    for (double& v : report.vector) v = in.f64();
    for (double& v : report.quaternion.coeffs()) v = in.f64();  // x y z w, as Eigen stores them
    if (in.left() > 0) report.dt_s = in.f64();
    EXPECT_EQ(in.left(), 0u);
    EXPECT_FALSE(in.failed());
    reports.push_back(report);
  }
  return reports;
}

std::vector<std::int32_t> ids(std::size_t bodies) {
  std::vector<std::int32_t> senders;
  for (std::size_t i = 0; i < bodies; ++i) senders.push_back(static_cast<std::int32_t>(i) + 1);
  return senders;
}

EncodedFrame encoded(const SceneFrame& frame, ReportContent content, const OutputAxes& axes = {}) {
  EncodedFrame out;
  ReportEncoder(axes, content).encode(frame, ids(frame.bodies.size()), {}, out);
  return out;
}

constexpr ReportContent kPoseOnly{false, false};
constexpr ReportContent kAll{true, true};

TEST(VrpnReportEncoder, ReportsPoseVelocityAndAccelerationOfEveryBody) {
  auto frame = make_scene_frame({"a", "b"});
  frame->bodies[1].a_WP = {0, 0, 0.5};
  const auto reports = decoded(encoded(*frame, kAll));
  ASSERT_EQ(reports.size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(reports[i].header.sender, i < 3 ? 1 : 2);
    EXPECT_EQ(reports[i].header.type, 4 + static_cast<int>(i % 3));
    EXPECT_EQ(reports[i].header.utc_ns, frame->utc_ns() / 1000 * 1000);
    EXPECT_EQ(reports[i].sensor, 0);
  }
  EXPECT_EQ(reports[3].vector, frame->bodies[1].X_WP.p);
  EXPECT_LT(angle_between(reports[3].quaternion, frame->bodies[1].X_WP.q), kRounding);
  EXPECT_EQ(reports[4].vector, frame->bodies[1].v_WP);
  EXPECT_EQ(reports[5].vector, frame->bodies[1].a_WP);
  EXPECT_EQ(reports[5].quaternion.coeffs(), Eigen::Quaterniond::Identity().coeffs());
  EXPECT_EQ(reports[5].dt_s, 1.0);
  EXPECT_EQ(decoded(encoded(*frame, kPoseOnly)).size(), 2u);
  EXPECT_EQ(decoded(encoded(*frame, {true, false})).back().header.type, 5);
  EXPECT_EQ(decoded(encoded(*frame, {false, true})).back().header.type, 6);
}

TEST(VrpnReportEncoder, OmitsInvalidBodiesBodiesWithoutSenderAndNonFiniteNumbers) {
  const auto expect_only = [](const EncodedFrame& out, std::int32_t sender) {
    const auto reports = decoded(out);
    ASSERT_EQ(reports.size(), 1u);
    EXPECT_EQ(reports[0].header.sender, sender);
    EXPECT_EQ(reports[0].header.type, 4);
  };
  auto frame = make_scene_frame({"a", "b"});
  EncodedFrame out;
  ReportEncoder({}, kPoseOnly).encode(*frame, std::vector<std::int32_t>{-1, 4}, {}, out);
  expect_only(out, 4);
  frame->bodies[0].valid = false;
  expect_only(encoded(*frame, kPoseOnly), 2);
  frame->bodies[0].valid = true;
  frame->bodies[0].X_WP.p.x() = std::numeric_limits<double>::quiet_NaN();
  frame->bodies[1].v_WP.x() = std::numeric_limits<double>::infinity();
  expect_only(encoded(*frame, {true, false}), 2);
  for (auto& body : frame->bodies) body.valid = false;
  ReportEncoder({}, kAll).encode(*frame, ids(2), {}, out);
  EXPECT_TRUE(out.bytes.empty());
  EXPECT_TRUE(out.datagram_ends.empty());
}

TEST(VrpnReportEncoder, RotationOfTheVelocityPredictsTheAttitudeInTheConfiguredAxes) {
  auto frame = make_scene_frame({"a"});
  auto& body = frame->bodies[0];
  for (const OutputAxes& axes : {OutputAxes{}, OutputAxes{UpAxis::kY, AxesScope::kWorld, 1.0},
                                 OutputAxes{UpAxis::kY, AxesScope::kWorldAndBody, 1.0}}) {
    for (const double rate : {0.0, 1e-9, 0.4, 2.8, 2.9, 20.0}) {
      body.w_WP_P = rate * Eigen::Vector3d(1, -2, 2) / 3;
      const BodyPose expected = to_client(body, axes);
      const auto reports = decoded(encoded(*frame, kAll, axes));
      EXPECT_LT((reports[0].vector - expected.X_WP.p).norm(), kRounding);
      EXPECT_LT(angle_between(reports[0].quaternion, expected.X_WP.q), 1e-9);
      EXPECT_LT((reports[1].vector - expected.v_WP).norm(), kRounding);
      EXPECT_LT((reports[2].vector - expected.a_WP).norm(), kRounding);
      // q(t + dt) = turn · q(t); the body rate is constant, so q(t + dt) = q(t) · exp(w_P dt).
      const auto& [header, sensor, vector, turn, dt_s] = reports[1];
      const Eigen::Quaterniond later = expected.X_WP.q * exp_so3(expected.w_WP_P * dt_s);
      EXPECT_LT(angle_between(turn * reports[0].quaternion, later), 1e-9) << rate;
      EXPECT_NEAR(dt_s, rate <= 0.9 * std::numbers::pi ? 1.0 : 0.9 * std::numbers::pi / rate,
                  kRounding);
      EXPECT_LT(log_so3(turn).norm(), std::numbers::pi);
    }
  }
}

TEST(VrpnReportEncoder, CutsDatagramsBetweenBodiesAtMost1472Bytes) {
  struct Case {
    ReportContent content;
    std::size_t body_bytes;
    std::size_t bodies_per_datagram;
  };
  for (const auto& [content, body_bytes, per_datagram] :
       {Case{kPoseOnly, 88, 16}, Case{{true, false}, 184, 8}, Case{kAll, 280, 5}}) {
    const auto out = encoded(*make_scene_frame(numbered_names(33)), content);
    std::size_t begin = 0;
    for (std::size_t i = 0; i < out.datagram_ends.size(); ++i) {
      const std::size_t size = out.datagram_ends[i] - begin;
      EXPECT_LE(size, 1472u);
      const bool last = i + 1 == out.datagram_ends.size();
      EXPECT_EQ(size, last ? (33 - i * per_datagram) * body_bytes : per_datagram * body_bytes);
      begin = out.datagram_ends[i];
    }
    EXPECT_EQ(begin, out.bytes.size());
    EXPECT_EQ(out.bytes.size(), 33 * body_bytes);
  }
}

TEST(VrpnReportEncoder, AllocatesNothingAfterWarmUp) {
  const auto frame = make_scene_frame(numbered_names(40));
  const auto senders = ids(40);
  for (const UpAxis up : {UpAxis::kZ, UpAxis::kY}) {
    const ReportEncoder encoder({up, AxesScope::kWorldAndBody, 1.0}, kAll);
    EncodedFrame out;
    encoder.encode(*frame, senders, {}, out);
    const AllocationCounter allocations;
    for (int i = 0; i < 100; ++i) encoder.encode(*frame, senders, {}, out);
    EXPECT_EQ(allocations.count(), 0u);
  }
}

TEST(VrpnReportEncoder, AdditionalSensorsMoveWithTheirBody) {
  auto frame = make_scene_frame({"arm", "drone"});
  BodyPose& arm = frame->bodies[0];
  const double c = std::sqrt(0.5);
  arm.X_WP = {Eigen::Quaterniond(c, 0, 0, c),
              {1, 2, 3}};  // x of the body points along y of the world
  arm.v_WP = {0.5, 0, 0};
  arm.w_WP_P = {0, 0, 2};
  arm.a_WP = {0, 0, 0};
  const std::vector<std::vector<Pose>> sensors{{{Eigen::Quaterniond(0, 1, 0, 0), {0.1, 0, 0}}}, {}};
  EncodedFrame out;
  ReportEncoder({}, kAll).encode(*frame, ids(2), sensors, out);
  const auto reports = decoded(out);
  std::vector<int> seen;
  for (const auto& one : reports) seen.push_back(one.sensor);
  ASSERT_THAT(seen, testing::ElementsAre(0, 0, 0, 1, 1, 1, 0, 0, 0));
  const auto expect_vector = [](const Report& tip, const Eigen::Vector3d& expected) {
    EXPECT_LT((tip.vector - expected).cwiseAbs().maxCoeff(), kRounding);
  };
  expect_vector(reports[3], {1, 2.1, 3});
  const Eigen::Vector4d half_turn_about_x(c, c, 0, 0);  // q_WP times it, as x y z w
  EXPECT_LT((reports[3].quaternion.coeffs() - half_turn_about_x).cwiseAbs().maxCoeff(), kRounding);
  expect_vector(reports[4], {0.5 - 0.2, 0, 0});  // 2 rad/s · 0.1 m, to the left of the tip
  expect_vector(reports[5], {0, -0.4, 0});       // 4 · 0.1 m, towards the pivot
}

TEST(VrpnReportEncoder, ReportsWhetherDatagramsHaveEqualSizes) {
  auto frame = make_scene_frame(numbered_names(12));
  EncodedFrame out = encoded(*frame, kAll);
  EXPECT_EQ(out.equal_cut(), 5u * 280);
  EXPECT_EQ(out.datagram_ends, (std::vector<std::size_t>{1400, 2800, 3360}));
  frame->bodies[1].v_WP.x() = std::numeric_limits<double>::quiet_NaN();  // one report less
  ReportEncoder({}, kAll).encode(*frame, ids(12), {}, out);
  EXPECT_EQ(out.equal_cut(), 0u);
  ReportEncoder({}, kAll).encode(*make_scene_frame({"a"}), ids(1), {}, out);
  EXPECT_EQ(out.equal_cut(), 0u);
}

}  // namespace
}  // namespace fiducap::vrpn
