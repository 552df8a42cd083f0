#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace fiducap::vrpn {

/// A VRPN client that shares no code with the server. It collects every violation of framing,
/// padding, sequence numbers, order of descriptions, payload sizes and datagram sizes. `pump` reads
/// all that came. It numbers senders and types unlike any server, so that confused ids show.
class StrictClient final {
 public:
  enum class CookieOrder { kFirst, kAfterServer };

  struct Report {
    std::string sender;
    std::string type;
    int sensor{};
    double utc_s{};
    std::vector<double> values;  ///< The doubles behind the two sensor words.
    bool udp{};
  };
  struct Text {
    std::string sender;
    std::uint32_t severity{};
    std::string text;
  };

  explicit StrictClient(CookieOrder order = CookieOrder::kFirst) : order_(order) {}
  ~StrictClient();
  StrictClient(const StrictClient&) = delete;
  StrictClient& operator=(const StrictClient&) = delete;

  void connect(std::uint16_t port);
  /// Opens a listener and a UDP receiver and sends the request. @param times  how often
  void request(std::uint16_t port, int times = 1, bool offer_udp = true);
  void pump();

  /// Sends an empty message: a ping or request.
  void ask(const std::string& body, const std::string& type);
  void send_raw(std::span<const std::byte> bytes);
  void stop_reading() { reading_ = false; }
  void resume_reading() { reading_ = true; }

  /// Sensors that a body may have; a report of another is a violation.
  void expect_sensors(int n) { sensors_ = n; }

  [[nodiscard]] bool closed_by_server() const { return closed_; }
  /// All 18 types are described.
  [[nodiscard]] bool ready() const { return types_.size() == 18; }
  /// Without VRPN Control, as discovery sees them.
  [[nodiscard]] std::vector<std::string> bodies() const;
  /// Waiting in the listener's backlog.
  [[nodiscard]] int extra_connections();

  std::vector<Report> reports;
  std::vector<Text> texts;
  std::vector<std::string> pongs;
  std::map<std::string, int> answers;  ///< To_Room, Unit_To_Sensor, Workspace by type name.
  std::vector<std::string> violations;

 private:
  struct Stream {
    std::vector<unsigned char> bytes;
    std::uint32_t sequence{0};
  };

  void say_hello();
  void describe(std::int32_t kind, std::int32_t id, const std::string& name);
  void send(const std::string& bytes) { send_raw(std::as_bytes(std::span(bytes))); }
  void read_tcp();
  void read_udp();
  void parse(Stream& stream, bool udp);
  void take(const unsigned char* message, std::size_t length, bool udp);
  void learn(std::map<std::int32_t, std::string>& table, std::int32_t id,
             const unsigned char* payload, std::size_t n);
  void violated(const std::string& what) { violations.push_back(what); }

  CookieOrder order_;
  int tcp_{-1}, udp_{-1}, listener_{-1};
  int sensors_{1};
  bool offer_udp_{false}, reading_{true}, closed_{false}, said_hello_{false}, cookie_seen_{false};
  Stream stream_;
  std::uint32_t udp_sequence_{0};
  std::map<std::int32_t, std::string> senders_, types_;
  std::map<std::string, std::int32_t> own_senders_, own_types_;
};

}  // namespace fiducap::vrpn
