#include "daemon/stream_loop.hpp"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <stdexcept>
#include <thread>

#include "support/fake_clock.hpp"
#include "support/fake_operator_api.hpp"
#include "support/scene_builder.hpp"

namespace fiducap {
namespace {

/// Records its calls, in order.
class Witness final : public Streamer {
 public:
  explicit Witness(std::string& story) : story_(story) {}
  [[nodiscard]] std::string_view protocol() const override { return "test"; }
  void publish(const std::shared_ptr<const SceneFrame>&) override { story_ += 'p'; }
  void append_clients(std::vector<ClientStatus>&) const override {}
  void stop() override { story_ += 's'; }

 private:
  std::string& story_;
};

TEST(StreamLoop, GivesFramesToItsProtocolsAndThenSaysSo) {
  std::string story;
  StreamLoop loop("test");
  loop.hub().add(std::make_unique<Witness>(story));
  loop.on_delivered([&](const auto&) {
    story += 'd';
    loop.stop();
  });
  loop.put(make_scene_frame({"robot"}));
  loop.run();
  EXPECT_EQ(story, "pds");
}

TEST(StreamLoop, GoesOnAfterAnException) {
  std::string story;
  StreamLoop loop("test");
  boost::asio::post(loop.io(), [] { throw std::runtime_error("a defect"); });
  boost::asio::post(loop.io(), [&] { story += 'x'; });
  loop.hub().add(std::make_unique<Witness>(story));
  loop.on_delivered([&](const auto&) { loop.stop(); });
  std::jthread publisher([&] { loop.put(make_scene_frame({"robot"})); });
  loop.run();
  EXPECT_EQ(story, "xps");
}

TEST(StreamLoop, EndsFromAnotherThread) {
  StreamLoop loop("test");
  std::jthread other([&] { loop.run(); });
  loop.stop();
}

/// What a page asks for is parsed, encoded and sent where no frame of another protocol waits for
/// it.
TEST(ProtocolServers, PagesAreServedBesideTheThreadOfTheFrames) {
  ServerConfig config;
  config.streaming = {};
  for_each_protocol([](std::string_view name, auto& one) { one.enabled = name == "web"; },
                    config.streaming);
  config.streaming.web.port = 0;
  FakeOperatorApi operator_api;
  const EventBoard events{[] { return std::int64_t{0}; }};
  const FakeClock clock;
  StreamLoop frames("frames");
  StreamLoop pages("pages");
  const auto ports = start_protocols(
      {frames, pages, config, std::make_shared<SceneModel>(), operator_api, events, clock, {}});
  ASSERT_TRUE(ports.has_value()) << ports.error().text();
  EXPECT_TRUE(frames.hub().empty());
  EXPECT_FALSE(pages.hub().empty());
}

TEST(ProtocolServers, EverythingElseIsServedOnTheThreadOfTheFrames) {
  ServerConfig config;
  for_each_protocol([](std::string_view name, auto& one) { one.enabled = name == "vrpn"; },
                    config.streaming);
  config.streaming.vrpn.port = 0;
  FakeOperatorApi operator_api;
  const EventBoard events{[] { return std::int64_t{0}; }};
  const FakeClock clock;
  StreamLoop frames("frames");
  StreamLoop pages("pages");
  const auto ports = start_protocols(
      {frames, pages, config, std::make_shared<SceneModel>(), operator_api, events, clock, {}});
  ASSERT_TRUE(ports.has_value()) << ports.error().text();
  EXPECT_FALSE(frames.hub().empty());
  EXPECT_TRUE(pages.hub().empty());
}

}  // namespace
}  // namespace fiducap
