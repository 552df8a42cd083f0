#include "strict_client.hpp"

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "support/loopback_socket.hpp"

namespace fiducap::vrpn {

namespace {

const std::vector<std::string> kAskable{
    "vrpn_Base ping_message", "vrpn_Tracker Request_Tracker_To_Room",
    "vrpn_Tracker Request_Unit_To_Sensor", "vrpn_Tracker Request_Tracker_Workspace"};
const std::map<std::string, std::size_t> kPayloads{
    {"vrpn_Tracker Pos_Quat", 64},       {"vrpn_Tracker Velocity", 72},
    {"vrpn_Tracker Acceleration", 72},   {"vrpn_Tracker To_Room", 56},
    {"vrpn_Tracker Unit_To_Sensor", 64}, {"vrpn_Tracker Workspace", 48},
    {"vrpn_Base pong_message", 0}};

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
void put_u32(std::string& out, std::uint32_t v) {
  for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(v >> shift & 0xff);
}

std::string packed(std::int32_t sender, std::int32_t type, const std::string& payload = {}) {
  std::string out;
  put_u32(out, static_cast<std::uint32_t>(24 + payload.size()));
  out += std::string(8, '\0');  // time
  put_u32(out, static_cast<std::uint32_t>(sender));
  put_u32(out, static_cast<std::uint32_t>(type));
  put_u32(out, 0);
  return out + payload + std::string((8 - payload.size() % 8) % 8, '\0');
}

}  // namespace

StrictClient::~StrictClient() {
  for (const int fd : {tcp_, udp_, listener_}) {
    if (fd >= 0) ::close(fd);
  }
}

void StrictClient::connect(std::uint16_t port) { tcp_ = connected_socket(port); }

void StrictClient::request(std::uint16_t port, int times, bool offer_udp) {
  offer_udp_ = offer_udp;
  listener_ = bound_socket(SOCK_STREAM);
  ::listen(listener_, 8);
  udp_ = bound_socket(SOCK_DGRAM);
  const std::string text = "127.0.0.1 " + std::to_string(port_of(listener_)) + '\0';
  for (int i = 0; i < times; ++i) send_datagram(udp_, std::as_bytes(std::span(text)), port);
}

int StrictClient::extra_connections() {
  int count = 0;
  for (int fd = 0; (fd = ::accept(listener_, nullptr, nullptr)) >= 0; ::close(fd)) ++count;
  return count;
}

void StrictClient::pump() {
  if (tcp_ < 0 && listener_ >= 0)
    tcp_ = ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (tcp_ < 0 || closed_) return;
  if (!said_hello_ && order_ == CookieOrder::kFirst) say_hello();
  if (!reading_) return;
  read_tcp();
  if (!said_hello_ && cookie_seen_) say_hello();
  if (udp_ >= 0) read_udp();
}

void StrictClient::say_hello() {
  said_hello_ = true;
  send(std::string("vrpn: ver. 07.33  0\0\xed\0\0\0", 24));
  if (offer_udp_) send(packed(port_of(udp_), -3, std::string("127.0.0.1\0", 10)));
  for (const auto& type : kAskable) {
    own_types_[type] = 1500 - 7 * static_cast<std::int32_t>(own_types_.size());
    describe(-2, own_types_[type], type);
  }
}

void StrictClient::describe(std::int32_t kind, std::int32_t id, const std::string& name) {
  std::string payload;
  put_u32(payload, static_cast<std::uint32_t>(name.size() + 1));
  send(packed(id, kind, payload + name + '\0'));
}

void StrictClient::ask(const std::string& body, const std::string& type) {
  const auto [entry, fresh] =
      own_senders_.try_emplace(body, 900 - 3 * static_cast<std::int32_t>(own_senders_.size()));
  if (fresh) describe(-1, entry->second, body);
  send(packed(entry->second, own_types_.at(type)));
}

void StrictClient::send_raw(std::span<const std::byte> bytes) {
  const auto sent = ::send(tcp_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent != static_cast<ssize_t>(bytes.size()) && errno != EPIPE && errno != ECONNRESET) {
    throw std::runtime_error("strict client cannot send");
  }
}

void StrictClient::read_tcp() {
  closed_ = !read_stream(tcp_, stream_.bytes);
  if (!cookie_seen_) {
    if (stream_.bytes.size() < 24) return;
    if (std::memcmp(stream_.bytes.data(), "vrpn: ver. 07.35  0\0\0\0\0\0", 24) != 0)
      violated("cookie");
    stream_.bytes.erase(stream_.bytes.begin(), stream_.bytes.begin() + 24);
    cookie_seen_ = true;
  }
  parse(stream_, false);
}

void StrictClient::read_udp() {
  while (auto bytes = read_datagram<unsigned char>(udp_)) {
    if (bytes->size() > 1472) violated("datagram of " + std::to_string(bytes->size()) + " bytes");
    Stream datagram{std::move(*bytes), udp_sequence_};
    parse(datagram, true);
    if (!datagram.bytes.empty()) violated("datagram does not end with a message");
    udp_sequence_ = datagram.sequence;
  }
}

void StrictClient::parse(Stream& stream, bool udp) {
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
    for (std::size_t i = length; i < size; ++i) {
      if (message[i] != 0) violated("padding is not zero");
    }
    if (get_u32(message + 8) > 999999) violated("microseconds");
    const std::uint32_t sequence = get_u32(message + 20);
    // By TCP an answer may overtake a frame that waits; by UDP every message follows the last.
    if (udp && sequence <= stream.sequence) violated("udp sequence");
    stream.sequence = sequence;
    take(message, length, udp);
    at += size;
  }
  stream.bytes.erase(stream.bytes.begin(), stream.bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

void StrictClient::take(const unsigned char* message, std::size_t length, bool udp) {
  const std::int32_t sender_id = get_i32(message + 12);
  const std::int32_t type_id = get_i32(message + 16);
  const unsigned char* payload = message + 24;
  const std::size_t n = length - 24;
  if (type_id < 0 && udp) violated("system message by UDP");
  if (type_id == -1) return learn(senders_, sender_id, payload, n);
  if (type_id == -2) return learn(types_, sender_id, payload, n);
  if (type_id < 0) return violated("system message " + std::to_string(type_id));
  const auto sender = senders_.find(sender_id);
  const auto type = types_.find(type_id);
  if (sender == senders_.end() || type == types_.end())
    return violated("used before it was described");
  if (const auto wanted = kPayloads.find(type->second);
      wanted != kPayloads.end() && wanted->second != n) {
    return violated(type->second + " with " + std::to_string(n) + " bytes");
  }
  if (type->second == "vrpn_Base text_message") {
    if (n < 9 || payload[n - 1] != 0) return violated("text without zero");
    texts.push_back({sender->second, get_u32(payload), reinterpret_cast<const char*>(payload + 8)});
  } else if (type->second == "vrpn_Base pong_message") {
    pongs.push_back(sender->second);
  } else if (type_id >= 4 && type_id <= 6) {
    const int sensor = get_i32(payload);
    if (sensor < 0 || sensor >= sensors_ || get_i32(payload + 4) != sensor) violated("sensor");
    const double utc_s = get_u32(message + 4) + 1e-6 * get_u32(message + 8);
    reports.push_back({sender->second, type->second, sensor, utc_s, {}, udp});
    for (std::size_t at = 8; at < n; at += 8)
      reports.back().values.push_back(get_f64(payload + at));
  } else {
    if (udp) violated("answer by UDP");
    ++answers[type->second];
  }
}

void StrictClient::learn(std::map<std::int32_t, std::string>& table, std::int32_t id,
                         const unsigned char* payload, std::size_t n) {
  if (n < 6 || get_u32(payload) != n - 4 || payload[n - 1] != 0 || n > 100)
    return violated("description");
  const std::string name(reinterpret_cast<const char*>(payload + 4));
  // Ids without holes, but for the private ones at the far end that explain an unknown name.
  if (id != static_cast<std::int32_t>(table.size()) && id < 1900)
    violated("id out of order: " + name);
  if (!table.emplace(id, name).second) violated("described twice: " + name);
}

std::vector<std::string> StrictClient::bodies() const {
  std::vector<std::string> names;
  for (const auto& [id, name] : senders_) {
    if (name != "VRPN Control") names.push_back(name);
  }
  return names;
}

}  // namespace fiducap::vrpn
