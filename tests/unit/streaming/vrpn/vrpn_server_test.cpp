#include "streaming/vrpn/vrpn.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <map>

#include "support/loopback_socket.hpp"
#include "unit/streaming/server_fixture.hpp"

namespace fiducap::vrpn {
namespace {

using testing::AllOf;
using testing::Each;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kRounding = 1e-12;

const std::map<std::string, std::size_t> kPayloads{{"vrpn_Tracker Pos_Quat", 64},
                                                   {"vrpn_Tracker Velocity", 72},
                                                   {"vrpn_Tracker Acceleration", 72}};

std::uint32_t get_u32(const unsigned char* p) {
  return std::uint32_t{p[0]} << 24 | std::uint32_t{p[1]} << 16 | std::uint32_t{p[2]} << 8 | p[3];
}
std::int32_t get_i32(const unsigned char* p) { return static_cast<std::int32_t>(get_u32(p)); }
double get_f64(const unsigned char* p) {
  const std::uint64_t bits = std::uint64_t{get_u32(p)} << 32 | get_u32(p + 4);
  double v = 0;
  std::memcpy(&v, &bits, 8);
  return v;
}

/// A VRPN client that shares no code with the server. It collects every violation of framing,
/// padding, sequence numbers, order of descriptions, payload sizes and datagram sizes. `pump` reads
/// all that came. It waits for the server's cookie before it sends its own.
class StrictClient final {
 public:
  struct Report {
    std::string sender, type;
    int sensor{};
    double utc_s{};
    std::vector<double> values;  ///< The doubles behind the two sensor words.
    bool udp{};
  };
  struct Text {
    std::string sender;
    std::uint32_t severity{};
  };

  StrictClient() = default;
  ~StrictClient() {
    for (const int fd : {tcp_, udp_, listener_})
      if (fd >= 0) ::close(fd);
  }
  StrictClient(const StrictClient&) = delete;
  StrictClient& operator=(const StrictClient&) = delete;

  void connect(std::uint16_t port) { tcp_ = connected_socket(port); }
  /// Opens a listener and a UDP receiver and sends the request. @param times  how often
  void request(std::uint16_t port, int times) {
    listener_ = bound_socket(SOCK_STREAM);
    ::listen(listener_, 8);
    udp_ = bound_socket(SOCK_DGRAM);
    const std::string text = "127.0.0.1 " + std::to_string(port_of(listener_)) + '\0';
    for (int i = 0; i < times; ++i) send_datagram(udp_, std::as_bytes(std::span(text)), port);
  }
  void pump() {
    if (tcp_ < 0 && listener_ >= 0)
      tcp_ = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (tcp_ < 0) return;
    read_tcp();
    if (udp_ >= 0) read_udp();
  }

  /// Sensors that a body may have; a report of another is a violation.
  void expect_sensors(int n) { sensors_ = n; }
  /// All 18 types are described.
  [[nodiscard]] bool ready() const { return types_.size() == 18; }
  /// Without VRPN Control, as discovery sees them.
  [[nodiscard]] std::vector<std::string> bodies() const {
    std::vector<std::string> names;
    for (const auto& [id, name] : senders_)
      if (name != "VRPN Control") names.push_back(name);
    return names;
  }
  /// Waiting in the listener's backlog.
  [[nodiscard]] int extra_connections() const {
    int count = 0;
    for (int fd = 0; (fd = ::accept(listener_, nullptr, nullptr)) >= 0; ::close(fd)) ++count;
    return count;
  }

  std::vector<Report> reports;
  std::vector<Text> texts;
  std::vector<std::string> violations;

 private:
  struct Stream {
    std::vector<unsigned char> bytes;
    std::uint32_t sequence{0};
  };

  void say_hello() {
    std::string hello("vrpn: ver. 07.33  0\0\xed\0\0\0", 24);
    if (udp_ >= 0) {  // length 34, no time; port, type -3, no sequence number; address
      const std::uint16_t port = port_of(udp_);
      hello += std::string("\0\0\0\x22\0\0\0\0\0\0\0\0\0\0", 14);
      hello += {static_cast<char>(port >> 8), static_cast<char>(port & 0xff)};
      hello += std::string(
          "\xff\xff\xff\xfd\0\0\0\0"
          "127.0.0.1\0\0\0\0\0\0\0",
          24);
    }
    const auto sent = ::send(tcp_, hello.data(), hello.size(), MSG_NOSIGNAL);
    if (sent != static_cast<ssize_t>(hello.size())) violated("cannot be sent a cookie");
  }
  void read_tcp() {
    if (!read_stream(tcp_, stream_.bytes)) violated("closed");
    if (!cookie_seen_) {
      if (stream_.bytes.size() < 24) return;
      if (std::memcmp(stream_.bytes.data(), "vrpn: ver. 07.35  0\0\0\0\0\0", 24) != 0)
        violated("cookie");
      stream_.bytes.erase(stream_.bytes.begin(), stream_.bytes.begin() + 24);
      cookie_seen_ = true;
      say_hello();
    }
    parse(stream_, false);
  }
  void read_udp() {
    while (auto bytes = read_datagram<unsigned char>(udp_)) {
      if (bytes->size() > 1472) violated("datagram of " + std::to_string(bytes->size()) + " bytes");
      Stream datagram{std::move(*bytes), udp_sequence_};
      parse(datagram, true);
      if (!datagram.bytes.empty()) violated("datagram does not end with a message");
      udp_sequence_ = datagram.sequence;
    }
  }
  void parse(Stream& stream, bool udp) {
    std::size_t at = 0;
    while (stream.bytes.size() - at >= 24) {
      const unsigned char* message = stream.bytes.data() + at;
      const std::size_t length = get_u32(message);
      if (length < 24 || length > 24 + 64000) {
        violated("length " + std::to_string(length));
        break;
      }
      const std::size_t size = 24 + (length - 24 + 7) / 8 * 8;
      if (stream.bytes.size() - at < size) break;
      for (std::size_t i = length; i < size; ++i)
        if (message[i] != 0) violated("padding is not zero");
      if (get_u32(message + 8) > 999999) violated("microseconds");
      const std::uint32_t sequence = get_u32(message + 20);
      // By TCP an answer may overtake a frame that waits; by UDP every message follows the last.
      if (udp && sequence <= stream.sequence) violated("udp sequence");
      stream.sequence = sequence;
      take(message, length, udp);
      at += size;
    }
    stream.bytes.erase(stream.bytes.begin(),
                       stream.bytes.begin() + static_cast<std::ptrdiff_t>(at));
  }
  void take(const unsigned char* message, std::size_t length, bool udp) {
    const std::int32_t sender_id = get_i32(message + 12);
    const std::int32_t type_id = get_i32(message + 16);
    const unsigned char* payload = message + 24;
    const std::size_t n = length - 24;
    if (type_id < 0 && udp) violated("system message by UDP");
    if (type_id == -1) return learn(senders_, sender_id, payload, n);
    if (type_id == -2) return learn(types_, sender_id, payload, n);
    const auto sender = senders_.find(sender_id);
    const auto type = types_.find(type_id);
    if (sender == senders_.end() || type == types_.end())
      return violated("used before it was described");
    if (type->second == "vrpn_Base text_message") {
      if (n < 9 || payload[n - 1] != 0) return violated("text without zero");
      texts.push_back({sender->second, get_u32(payload)});
      return;
    }
    const auto wanted = kPayloads.find(type->second);
    if (wanted == kPayloads.end() || wanted->second != n)
      return violated(type->second + " with " + std::to_string(n) + " bytes");
    const int sensor = get_i32(payload);
    if (sensor < 0 || sensor >= sensors_ || get_i32(payload + 4) != sensor) violated("sensor");
    const double utc_s = get_u32(message + 4) + 1e-6 * get_u32(message + 8);
    reports.push_back({sender->second, type->second, sensor, utc_s, {}, udp});
    for (std::size_t at = 8; at < n; at += 8)
      reports.back().values.push_back(get_f64(payload + at));
  }
  void learn(std::map<std::int32_t, std::string>& table, std::int32_t id,
             const unsigned char* payload, std::size_t n) {
    if (n < 6 || get_u32(payload) != n - 4 || payload[n - 1] != 0 || n > 100)
      return violated("description");
    const std::string name(reinterpret_cast<const char*>(payload + 4));
    if (id != static_cast<std::int32_t>(table.size())) violated("id out of order: " + name);
    if (!table.emplace(id, name).second) violated("described twice: " + name);
  }
  void violated(const std::string& what) { violations.push_back(what); }

  int tcp_{-1}, udp_{-1}, listener_{-1};
  int sensors_{1};
  bool cookie_seen_{false};
  Stream stream_;
  std::uint32_t udp_sequence_{0};
  std::map<std::int32_t, std::string> senders_, types_;
};

class VrpnServerTest : public ProtocolServerTest<StrictClient, VrpnConfig> {
 protected:
  void TearDown() override {
    for (const auto* client : clients_) EXPECT_THAT(client->violations, IsEmpty());
  }
  /// Connects by TCP and waits for the descriptions.
  void join(StrictClient& client) {
    client.connect(port_);
    wait_until_ready(client);
  }
  /// Requests a connection by a datagram and waits for the descriptions.
  void join_by_request(StrictClient& client, int times = 1) {
    client.request(port_, times);
    wait_until_ready(client);
  }
  /// Publishes a frame; each client then has this many reports.
  void publish_to_all(std::size_t reports, std::shared_ptr<SceneFrame> scene = nullptr) {
    server_->publish(scene ? scene : frame());
    for (auto* client : clients_)
      ASSERT_TRUE(until([&] { return client->reports.size() == reports; }));
  }

  StrictClient a_, b_;

 private:
  void wait_until_ready(StrictClient& client) {
    clients_.push_back(&client);
    ASSERT_TRUE(until([&] { return client.ready(); }));
  }
};

TEST_F(VrpnServerTest, ServesADirectClientByTcp) {
  start();
  join(a_);
  EXPECT_THAT(a_.bodies(), ElementsAre("arm", "drone"));
  publish_to_all(4);
  const auto report = [](const char* sender, const char* type) {
    return AllOf(Field(&StrictClient::Report::sender, sender),
                 Field(&StrictClient::Report::type, type), Field(&StrictClient::Report::udp, false),
                 // 2023-11-14 22:13:25.010 UTC, the stamp of the frame; doubles hold it to less
                 // than a microsecond.
                 Field(&StrictClient::Report::utc_s, testing::DoubleNear(1700000005.010, 1e-6)));
  };
  EXPECT_THAT(a_.reports, ElementsAre(report("arm", "vrpn_Tracker Pos_Quat"),
                                      report("arm", "vrpn_Tracker Velocity"),
                                      report("drone", "vrpn_Tracker Pos_Quat"),
                                      report("drone", "vrpn_Tracker Velocity")));
  EXPECT_EQ(a_.reports[2].values[0], 2.0);
}

TEST_F(VrpnServerTest, ServesARequestingClientByUdpOnOneConnection) {
  start();
  join_by_request(a_, 5);
  EXPECT_THAT(status().at(0).peer, HasSubstr(" udp"));
  publish();
  publish_to_all(8);
  EXPECT_THAT(a_.reports, Each(Field(&StrictClient::Report::udp, true)));
  EXPECT_EQ(status().at(0).frames_sent, 2u);
  steps(20);
  EXPECT_EQ(a_.extra_connections(), 0);
  EXPECT_THAT(status(), SizeIs(1));
}

TEST_F(VrpnServerTest, SensorsMoveWithTheirBodyAlsoUnderAnAlias) {
  config_.velocity = false;
  config_.aliases = {{"drone", "cf7"}};
  const Pose X_PS{Eigen::Quaterniond(0, 1, 0, 0), {0.1, 0.2, -0.3}};
  config_.sensors = {{"drone", X_PS}};
  start();
  for (auto* client : {&a_, &b_}) client->expect_sensors(2);
  join(a_);
  join_by_request(b_);
  EXPECT_THAT(a_.bodies(), ElementsAre("arm", "cf7"));
  const auto sent = frame();
  publish_to_all(3, sent);
  const Pose X_WS = sent->bodies[1].X_WP * X_PS;
  for (const auto* client : clients_) {
    EXPECT_EQ(client->reports[1].sensor, 0);
    const auto& extra = client->reports[2];
    EXPECT_EQ(extra.sender, "cf7");
    EXPECT_EQ(extra.sensor, 1);
    ASSERT_EQ(extra.values.size(), 7u);
    EXPECT_LT((Eigen::Vector3d(extra.values.data()) - X_WS.p).norm(), kRounding);
    const Eigen::Quaterniond q(extra.values[6], extra.values[3], extra.values[4], extra.values[5]);
    EXPECT_NEAR(std::abs(q.dot(X_WS.q)), 1.0, kRounding);
  }
}

TEST_F(VrpnServerTest, DescribesAnAddedBodyBeforeItsFirstReport) {
  start({"arm"});
  join(a_);
  names_ = {"arm", "rover"};
  auto later = frame();
  auto model = std::make_shared<SceneModel>(*later->model);
  model->generation = 2;
  later->model = model;
  publish_to_all(4, later);
  EXPECT_THAT(a_.bodies(), ElementsAre("arm", "rover"));
  EXPECT_EQ(a_.reports[2].sender, "rover");
}

TEST_F(VrpnServerTest, ReportsALostBodyToEveryClientAndStopsItsReports) {
  start();
  join(a_);
  join_by_request(b_);
  publish();
  auto lost = frame();
  lost->bodies[0].valid = false;
  lost->bodies[0].state = BodyState::kLost;
  publish_to_all(6, lost);
  ASSERT_TRUE(until([&] { return b_.texts.size() == 1; }));
  ASSERT_EQ(a_.texts.size(), 1u);
  EXPECT_EQ(a_.texts[0].sender, "arm");
  EXPECT_EQ(a_.texts[0].severity, 1u);
  EXPECT_EQ(a_.reports[4].sender, "drone");
}

TEST_F(VrpnServerTest, StatusShowsPeerTransportAndContent) {
  config_.acceleration = true;
  start();
  join(a_);
  clock_.advance(std::chrono::seconds(7));
  const auto all = status();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].protocol, "vrpn");
  EXPECT_THAT(all[0].peer, AllOf(HasSubstr("127.0.0.1:"), HasSubstr(" tcp")));
  EXPECT_EQ(all[0].detail, "z-up m, velocity on, acceleration on");
  EXPECT_DOUBLE_EQ(all[0].connected_s, 7.0);
}

}  // namespace
}  // namespace fiducap::vrpn
