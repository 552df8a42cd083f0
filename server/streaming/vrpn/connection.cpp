#include "streaming/vrpn/connection.hpp"

#include <algorithm>
#include <utility>

namespace fiducap::vrpn {

namespace {

constexpr std::size_t kMaxExplained = 4;

bool in_range(std::int32_t id) { return id >= 0 && id < kMaxIds; }

Header header_of(std::int64_t utc_ns, std::int32_t sender, Type type) {
  return {utc_ns, sender, static_cast<std::int32_t>(type), 0};
}

std::string printable(std::string_view text) {
  std::string out;
  for (const char c : text) out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '.' : c;
  return out;
}

}  // namespace

Connection::Connection(const VrpnConfig& config, const SenderTable& senders, Origin origin)
    : config_(config), senders_(senders), origin_(origin) {
  const auto& box = config.workspace_box_m;
  const AxesChange axes(config.axes());
  const Eigen::Vector3d a = axes.length({box[0], box[1], box[2]});
  const Eigen::Vector3d b = axes.length({box[3], box[4], box[5]});
  box_low_ = a.cwiseMin(b);  // turned axes may swap the ends
  box_high_ = a.cwiseMax(b);
}

std::vector<std::byte> Connection::greeting() const {
  std::vector<std::byte> cookie;
  encode_cookie(config_.minor_version, cookie);
  return cookie;
}

Expected<void> Connection::receive(std::span<const std::byte> bytes, std::int64_t utc_ns,
                                   std::vector<std::byte>& out) {
  in_.insert(in_.end(), bytes.begin(), bytes.end());
  std::size_t used = 0;
  if (!cookie_) {
    if (in_.size() < kCookieSize) return {};
    const auto cookie = decode_cookie(in_);
    if (!cookie) return tl::unexpected(cookie.error());
    cookie_ = *cookie;
    used = kCookieSize;
    greet_back(utc_ns, out);
  }
  for (;;) {
    const auto rest = std::span<const std::byte>(in_).subspan(used);
    const auto size = occupied_size(rest);
    if (!size) return tl::unexpected(size.error());
    if (*size == 0 || rest.size() < *size) break;
    const auto message = decode_message(rest);
    if (!message) return tl::unexpected(message.error());
    handle(*message, utc_ns, out);
    used += message->size;
  }
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
  return {};
}

void Connection::greet_back(std::int64_t utc_ns, std::vector<std::byte>& out) {
  describe_new_senders(utc_ns, out);
  for (std::size_t id = 0; id < kTypeNames.size(); ++id) {
    encode_description({utc_ns, static_cast<std::int32_t>(id), kTypeDescription, 0}, kTypeNames[id],
                       out);
  }
}

void Connection::describe_new_senders(std::int64_t utc_ns, std::vector<std::byte>& out) {
  if (!cookie_) return;
  const auto names = senders_.names();
  for (; described_ < names.size(); ++described_) {
    encode_description({utc_ns, static_cast<std::int32_t>(described_), kSenderDescription, 0},
                       names[described_], out);
  }
}

void Connection::handle(const Message& message, std::int64_t utc_ns, std::vector<std::byte>& out) {
  switch (message.header.type) {
    case kSenderDescription:
      return learn_sender(message);
    case kTypeDescription:
      return learn_type(message);
    case kUdpDescription:
      return learn_udp_port(message);
    default:
      break;
  }
  const auto type = peer_types_.find(message.header.type);
  if (type != peer_types_.end()) answer(type->second, message, utc_ns, out);
}

void Connection::learn_sender(const Message& message) {
  const auto name = decode_name(message.payload);
  if (!name) return note(log::Level::kDebug, name.error().text());
  if (in_range(message.header.sender)) peer_senders_[message.header.sender] = std::string(*name);
}

void Connection::learn_type(const Message& message) {
  const auto name = decode_name(message.payload);
  if (!name) return note(log::Level::kDebug, name.error().text());
  if (!in_range(message.header.sender)) return;
  const auto known = std::find(kTypeNames.begin(), kTypeNames.end(), *name);
  if (known == kTypeNames.end()) {
    peer_types_.erase(message.header.sender);  // the id may have been another type before
  } else {
    peer_types_[message.header.sender] = static_cast<Type>(known - kTypeNames.begin());
  }
}

void Connection::learn_udp_port(const Message& message) {
  if (origin_ == Origin::kDirect || !config_.udp_reports) return;
  const auto port = decode_udp_description(message);
  if (!port) return note(log::Level::kWarning, port.error().text());
  udp_port_ = *port;
}

void Connection::answer(Type type, const Message& message, std::int64_t utc_ns,
                        std::vector<std::byte>& out) {
  if (type == Type::kText) {
    const auto text = decode_text(message.payload);
    return note(log::Level::kDebug, text ? "says: " + printable(text->text) : text.error().text());
  }
  const auto name = peer_senders_.find(message.header.sender);
  if (name == peer_senders_.end()) return;
  const auto body = senders_.find_body(name->second);
  if (!body) {
    if (type == Type::kPing) explain_unknown_body(name->second, utc_ns, out);
    return;
  }
  switch (type) {
    case Type::kPing:
      return encode_empty(header_of(utc_ns, *body, Type::kPong), out);
    case Type::kRequestToRoom:
      return encode_to_room(header_of(utc_ns, *body, Type::kToRoom), Pose{}, out);
    case Type::kRequestUnitToSensor: {
      const auto sensors =
          static_cast<int>(config_.sensors_of(senders_.own_name_of(*body)).size()) + 1;
      for (int i = 0; i < sensors; ++i) {  // reports are of the sensors already
        encode_unit_to_sensor(header_of(utc_ns, *body, Type::kUnitToSensor), i, Pose{}, out);
      }
      return;
    }
    case Type::kRequestWorkspace:
      return encode_workspace(header_of(utc_ns, *body, Type::kWorkspace), box_low_, box_high_, out);
    default:
      return;  // set_update_rate, Reset_Origin: a client must not change what others see
  }
}

void Connection::explain_unknown_body(const std::string& name, std::int64_t utc_ns,
                                      std::vector<std::byte>& out) {
  if (explained_.size() >= kMaxExplained || name.size() > kMaxNameBytes) return;
  if (std::find(explained_.begin(), explained_.end(), name) != explained_.end()) return;
  // A client prints only what comes from a sender it watches, so the name gets an id at the far end
  // of the table, on this connection only. No pong: the client keeps saying that there is no such
  // body, which is true.
  const auto id =
      static_cast<std::int32_t>(static_cast<std::size_t>(kMaxIds) - 1 - explained_.size());
  if (static_cast<std::size_t>(id) < senders_.names().size()) return;
  explained_.push_back(name);
  const std::string text = "no body of this name here; there are: " + list_for_people();
  encode_description({utc_ns, id, kSenderDescription, 0}, name, out);
  encode_text(header_of(utc_ns, id, Type::kText), {Severity::kWarning, 0, text}, out);
  note(log::Level::kWarning,
       "asks for the body \"" + printable(name) + "\"; there are: " + list_for_people());
}

std::string Connection::list_for_people() const {
  constexpr std::size_t kEnough = 400;
  const std::string list = senders_.list_bodies();
  return list.size() <= kEnough ? list : list.substr(0, kEnough) + " ...";
}

std::vector<Note> Connection::take_notes() { return std::exchange(notes_, {}); }

void Connection::note(log::Level level, std::string text) {
  if (notes_left_ == 0) return;
  --notes_left_;
  notes_.push_back({level, std::move(text)});
}

}  // namespace fiducap::vrpn
