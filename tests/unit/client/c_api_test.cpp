#include <fiducap.h>
#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "support/allocation_counter.hpp"
#include "support/fake_operator_api.hpp"
#include "support/shell.hpp"
#include "test_server.hpp"

extern "C" int fiducap_layout_is_checked(void);

namespace fiducap {
namespace {

using testing::HasSubstr;

class CApiTest : public testing::Test {
 protected:
  CApiTest() {
    operator_api_.known = {
        {"sunday", RecordingStatus::State::kFailed, "the disk is full", 1200, 34567, 8}};
  }
  void connect() {
    fiducap_options options = fiducap_options_init();
    options.port = server_.port();
    options.reconnect_s = 0.1;
    client_ = fiducap_connect(&options, nullptr, 0);
    ASSERT_NE(client_, nullptr);
    ASSERT_TRUE(publish_until(server_, *scene_,
                              [&] { return fiducap_latest(client_, &frame_, bodies_, 3) == 1; }));
  }
  ~CApiTest() override { fiducap_disconnect(client_); }

  std::shared_ptr<SceneFrame> scene_ = make_scene_frame({"drone", "arm", "cart"});
  FakeOperatorApi operator_api_;
  EventBoard board_{[] { return std::int64_t{1'700'000'000'000'000'000}; }};
  TestServer server_{*scene_, 0, {}, &operator_api_, nullptr, &board_};
  fiducap_client* client_{nullptr};
  fiducap_frame frame_ = fiducap_frame_init();
  fiducap_body bodies_[3]{};
  char problem_[FIDUCAP_TEXT_SIZE] = "";
};

TEST_F(CApiTest, ReturnsTheNewestFrame) {
  connect();
  EXPECT_EQ(frame_.body_count, 3u);
  EXPECT_GT(frame_.number, 0u);
  EXPECT_STREQ(bodies_[1].name, "arm");
  EXPECT_EQ(bodies_[1].struct_size, sizeof(fiducap_body));
  EXPECT_EQ(bodies_[1].valid, 1);
  EXPECT_EQ(bodies_[1].position_m[0], 2.0);
  EXPECT_EQ(bodies_[1].velocity_m_s[2], 0.125);
  fiducap_body one[1]{};
  ASSERT_EQ(fiducap_latest(client_, &frame_, one, 1), 1);
  EXPECT_EQ(frame_.body_count, 3u) << "also those without room";
  EXPECT_EQ(fiducap_latest(client_, &frame_, nullptr, 0), 1) << "only the header";
}

TEST_F(CApiTest, OlderProgramsGetOnlyTheFieldsTheyKnow) {
  connect();
  // A body of a version that ended after the position, in an array of that stride.
  constexpr std::uint32_t kOldBody = offsetof(fiducap_body, orientation_wxyz);
  alignas(8) unsigned char old[2 * kOldBody + 8];
  std::fill(std::begin(old), std::end(old), 0xee);
  fiducap_frame frame = fiducap_frame_init();
  frame.body_size = kOldBody;
  frame.struct_size = offsetof(fiducap_frame, at_client_ns);
  frame.at_client_ns = 42;
  ASSERT_EQ(fiducap_latest(client_, &frame, reinterpret_cast<fiducap_body*>(old), 2), 1);
  double x = 0;
  std::memcpy(&x, old + kOldBody + offsetof(fiducap_body, position_m), sizeof(x));
  EXPECT_EQ(x, 2.0) << "the second body has the offset of the old version";
  EXPECT_EQ(old[2 * kOldBody], 0xee) << "nothing behind its array is written";
  EXPECT_EQ(frame.at_client_ns, 42) << "nor behind its frame";
  EXPECT_EQ(frame.struct_size, offsetof(fiducap_frame, at_client_ns));
}

TEST_F(CApiTest, LatestAndPredictAllocateNothing) {
  connect();
  fiducap_body body = fiducap_body_init();
  EXPECT_EQ(fiducap_predict(client_, "drone", 50'000'000, &body), 1);
  // Other threads may renew a lease meanwhile; a thousand readings that allocated would be more.
  constexpr std::uint64_t kOfARenewal = 100;
  const AllocationCounter allocations;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(fiducap_latest(client_, &frame_, bodies_, 3), 1);
    EXPECT_EQ(fiducap_predict(client_, "drone", 50'000'000, &body), 1);
  }
  EXPECT_LT(allocations.count(), kOfARenewal);
  EXPECT_NEAR(body.position_m[0], 1.025, 1e-9);
}

TEST_F(CApiTest, CountsAndDiscovers) {
  connect();
  fiducap_statistics statistics = fiducap_statistics_init();
  fiducap_get_statistics(client_, &statistics);
  EXPECT_EQ(statistics.connected, 1);
  EXPECT_GE(statistics.frames, 1u);
  EXPECT_STREQ(statistics.problem, "");
  fiducap_found found[4] = {fiducap_found_init(), fiducap_found_init(), fiducap_found_init(),
                            fiducap_found_init()};
  ASSERT_EQ(fiducap_discover(200, server_.port(), found, 4), 1u);
  EXPECT_STREQ(found[0].address, "127.0.0.1");
}

TEST_F(CApiTest, ReportsInvalidOptionsAndIgnoresNull) {
  const char* names[33];
  for (auto& name : names) name = "b";
  fiducap_options options = fiducap_options_init();
  options.bodies = names;
  options.body_count = 33;
  EXPECT_EQ(fiducap_connect(&options, problem_, sizeof(problem_)), nullptr);
  EXPECT_THAT(std::string(problem_), HasSubstr("32 bodies"));
  char tiny[5];
  EXPECT_EQ(fiducap_connect(&options, tiny, sizeof(tiny)), nullptr);
  EXPECT_STREQ(tiny, "fidu");
  EXPECT_EQ(fiducap_latest(nullptr, &frame_, bodies_, 3), 0);
  EXPECT_EQ(fiducap_predict(nullptr, "a", 0, nullptr), 0);
  fiducap_get_statistics(nullptr, nullptr);
  fiducap_disconnect(nullptr);
  fiducap_control_close(nullptr);
}

TEST_F(CApiTest, Controls) {
  fiducap_control* control =
      fiducap_control_open("127.0.0.1", server_.port(), "correct horse", 20'000);
  fiducap_controlled_body bodies[2] = {fiducap_controlled_body_init(),
                                       fiducap_controlled_body_init()};
  std::uint32_t count = 2;
  int mapping = -1;
  char recording[FIDUCAP_NAME_SIZE];
  ASSERT_EQ(fiducap_control_list(control, bodies, &count, &mapping, recording, problem_,
                                 sizeof(problem_)),
            1)
      << problem_;
  EXPECT_EQ(count, 2u);
  EXPECT_STREQ(bodies[1].name, "arm");
  EXPECT_EQ(bodies[1].pivot_position_m[2], 0.3);
  EXPECT_EQ(mapping, 0);
  fiducap_recording recordings[2] = {fiducap_recording_init(), fiducap_recording_init()};
  count = 2;
  ASSERT_EQ(fiducap_control_recordings(control, recordings, &count, problem_, sizeof(problem_)), 1);
  ASSERT_EQ(count, 1u);
  EXPECT_STREQ(recordings[0].name, "sunday");
  EXPECT_EQ(recordings[0].state, FIDUCAP_RECORDING_FAILED);
  EXPECT_STREQ(recordings[0].reason, "the disk is full");
  EXPECT_EQ(recordings[0].bytes, 34567u);
  EXPECT_EQ(fiducap_control_rename(control, 5, "x", problem_, sizeof(problem_)), 0);
  EXPECT_THAT(std::string(problem_), HasSubstr("5"));
  EXPECT_EQ(fiducap_control_commit_map(control, nullptr, 0), 1);
  EXPECT_EQ(operator_api_.changes.size(), 1U);
  fiducap_control_close(control);
}

TEST_F(CApiTest, ReportsEventsAndConditions) {
  board_.begin({.severity = Severity::kWarning,
                .subject = "clock",
                .kind = "unsynchronised",
                .text = std::string(1000, 'x'),
                .remedy = "Start chrony."});
  fiducap_events* events = fiducap_events_open(nullptr, server_.port(), 1);
  ASSERT_NE(events, nullptr);
  fiducap_event event = fiducap_event_init();
  problem_[0] = '?';
  ASSERT_EQ(fiducap_events_next(events, 20'000, &event, problem_, sizeof(problem_)), 1) << problem_;
  EXPECT_EQ(event.severity, FIDUCAP_EVENT_WARNING);
  EXPECT_EQ(event.number, 1u);
  EXPECT_EQ(event.at_utc_ms, 1'700'000'000'000);
  EXPECT_STREQ(event.subject, "clock");
  EXPECT_STREQ(event.kind, "unsynchronised");
  EXPECT_STREQ(event.remedy, "Start chrony.");
  EXPECT_EQ(std::string(event.text), std::string(512, 'x')) << "long texts are cut";
  fiducap_event standing[2] = {fiducap_event_init(), fiducap_event_init()};
  EXPECT_EQ(fiducap_events_standing(events, standing, 2), 1u);
  EXPECT_STREQ(standing[0].kind, "unsynchronised");
  EXPECT_EQ(fiducap_events_next(events, 0, &event, problem_, sizeof(problem_)), 0);
  EXPECT_STREQ(problem_, "");
  fiducap_events_close(events);
}

TEST_F(CApiTest, ServesThePythonPackage) {
  board_.begin({.severity = Severity::kError,
                .subject = "drone",
                .kind = "lost",
                .text = "lost, sees no tags",
                .remedy = "Look at the camera."});
#ifdef FIDUCAP_SANITIZED
  GTEST_SKIP() << "python3 cannot load a library with a sanitizer in it";
#endif
  if (!shell("python3 -c 'import sys; sys.exit(sys.version_info < (3, 8))'").done)
    GTEST_SKIP() << "no python3 (3.8 or newer)";
  const std::string package = std::string(FIDUCAP_SOURCE_DIR) + "/client/python";
  auto python = std::async(std::launch::async, [&] {
    return shell("FIDUCAP_LIBRARY=" FIDUCAP_C_LIBRARY " FIDUCAP_TEST_PORT=" +
                 std::to_string(server_.port()) + " PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=" +
                 package + " python3 -m unittest discover -s " + package + "/tests");
  });
  EXPECT_TRUE(publish_until(server_, *scene_, [&] {
    return python.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  }));
  const Shell run = python.get();
  EXPECT_TRUE(run.done) << run.output;
  EXPECT_THAT(run.output, testing::AllOf(HasSubstr("\nOK"), HasSubstr("Ran "),
                                         testing::Not(HasSubstr("Ran 0 tests"))));
}

TEST(CAbi, ExportsExactlyTheListedFunctions) {
  std::istringstream lines(shell(std::string("nm -D --defined-only ") + FIDUCAP_C_LIBRARY).output);
  std::set<std::string> exported;
  std::string address, kind, name;
  while (lines >> address >> kind >> name) {
    if (kind != "A") exported.insert(name.substr(0, name.find('@')));  // A: the version's own name
  }
  std::ifstream file(std::string(FIDUCAP_SOURCE_DIR) + "/client/abi/fiducap.symbols");
  std::set<std::string> listed;
  while (file >> name) listed.insert(name);
  EXPECT_EQ(exported, listed);
  EXPECT_EQ(fiducap_abi_version(), FIDUCAP_ABI_VERSION);
  EXPECT_EQ(fiducap_layout_is_checked(), 1);
}

}  // namespace
}  // namespace fiducap
