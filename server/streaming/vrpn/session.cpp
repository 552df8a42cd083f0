#include "streaming/vrpn/session.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/text.hpp"
namespace fiducap::vrpn {

namespace {

constexpr Duration kReportPeriod = std::chrono::seconds(1);
constexpr std::size_t kMaxExplained = 4;

bool in_range(std::int32_t id) { return id >= 0 && id < kMaxIds; }

}  // namespace

std::vector<ConfigError> check_body_name(const std::string& path, std::string_view name) {
  const bool plain = std::ranges::none_of(name, [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return byte < 0x20 || byte == 0x7f;
  });
  return Checker{""}
      .require(!name.empty() && name.size() <= kMaxNameBytes, path, name,
               "must have 1 to 95 bytes (VRPN clients drop the connection at longer names)")
      .require(name.find('@') == std::string_view::npos, path, name,
               "must not contain '@' (VRPN clients write name@host)")
      .require(plain, path, name, "must not contain control characters")
      .require(name != kControlName, path, name, "is the name of VRPN's own control sender")
      .errors;
}

SenderTable::SenderTable(NameAliases aliases)
    : aliases_(std::move(aliases)), names_{std::string(kControlName)} {}

std::vector<std::string> SenderTable::update(const SceneModel& model) {
  std::vector<std::string> refused;
  if (generation_ == model.generation) return refused;
  generation_ = model.generation;
  of_bodies_.clear();
  own_names_.clear();
  for (const auto& body : model.bodies) {
    const auto alias = aliases_.find(body.name);
    const std::string& name = alias == aliases_.end() ? body.name : alias->second;
    const std::int32_t id = check_body_name("", name).empty() ? id_for(name) : kNone;
    const bool doubled = std::find(of_bodies_.begin(), of_bodies_.end(), id) != of_bodies_.end();
    of_bodies_.push_back(doubled ? kNone : id);
    own_names_.push_back(body.name);
    if (of_bodies_.back() == kNone) refused.push_back(name);
  }
  return refused;
}

std::int32_t SenderTable::id_for(const std::string& name) {
  const auto known = std::find(names_.begin(), names_.end(), name);
  const auto id = static_cast<std::int32_t>(known - names_.begin());
  if (known != names_.end()) return id;
  if (id >= kMaxIds) return kNone;
  names_.push_back(name);
  return id;
}

std::optional<std::int32_t> SenderTable::find_body(std::string_view name) const {
  for (const std::int32_t id : of_bodies_)
    if (id != kNone && names_[static_cast<std::size_t>(id)] == name) return id;
  return std::nullopt;
}

const std::string& SenderTable::own_name_of(std::int32_t id) const {
  const auto at = std::find(of_bodies_.begin(), of_bodies_.end(), id);
  FIDUCAP_ASSERT(at != of_bodies_.end());
  return own_names_[static_cast<std::size_t>(at - of_bodies_.begin())];
}

std::string SenderTable::list_bodies() const {
  std::string list;
  for (const std::int32_t id : of_bodies_) {
    if (id == kNone) continue;
    if (!list.empty()) list += ", ";
    list += names_[static_cast<std::size_t>(id)];
  }
  return list.empty() ? "none" : list;
}

void BodyWatch::observe(const SceneFrame& frame, std::span<const std::int32_t> sender_of_body,
                        std::vector<std::byte>& out) {
  const std::size_t count = std::min(frame.bodies.size(), sender_of_body.size());
  for (std::size_t i = 0; i < count; ++i) {
    if (sender_of_body[i] < 0) continue;
    const auto sender = static_cast<std::size_t>(sender_of_body[i]);
    if (sender >= by_sender_.size()) by_sender_.resize(sender + 1);
    Seen& seen = by_sender_[sender];
    const bool valid = frame.bodies[i].valid;
    seen.ever = seen.ever || valid;
    if (!seen.ever || valid == seen.reported_valid) continue;
    if (seen.reported_at && frame.at - *seen.reported_at < kReportPeriod) continue;
    seen.reported_valid = valid;
    seen.reported_at = frame.at;
    encode_text(header_of(frame.utc_ns(), sender_of_body[i], Type::kText),
                valid ? TextMessage{Severity::kNormal, 0, "tracked again"}
                      : TextMessage{Severity::kWarning, 0,
                                    "not tracked any more: no reports until tags are seen again"},
                out);
  }
}

Connection::Connection(const VrpnConfig& config, const SenderTable& senders, Origin origin)
    : config_(config), senders_(senders), origin_(origin) {
  const auto& box = config.workspace_box_m;
  const AxesChange axes(config.axes());
  const Eigen::Vector3d a = axes.length({box[0], box[1], box[2]});
  const Eigen::Vector3d b = axes.length({box[3], box[4], box[5]});
  box_low_ = a.cwiseMin(b);  // a change of axes may swap the ends
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
    describe_new_senders(utc_ns, out);
    for (std::size_t id = 0; id < kTypeNames.size(); ++id)
      encode_description({utc_ns, static_cast<std::int32_t>(id), kTypeDescription, 0},
                         kTypeNames[id], out);
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

void Connection::describe_new_senders(std::int64_t utc_ns, std::vector<std::byte>& out) {
  if (!cookie_) return;
  const auto names = senders_.names();
  for (; described_ < names.size(); ++described_)
    encode_description({utc_ns, static_cast<std::int32_t>(described_), kSenderDescription, 0},
                       names[described_], out);
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
    return note(log::Level::kDebug,
                text ? "sent text: " + printable(text->text) : text.error().text());
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
      for (int i = 0; i < sensors; ++i) {  // reports are already those of the sensors
        encode_unit_to_sensor(header_of(utc_ns, *body, Type::kUnitToSensor), i, Pose{}, out);
      }
      return;
    }
    case Type::kRequestWorkspace:
      return encode_workspace(header_of(utc_ns, *body, Type::kWorkspace), box_low_, box_high_, out);
    default:
      return;  // set_update_rate, Reset_Origin: would change the data of other clients
  }
}

void Connection::explain_unknown_body(const std::string& name, std::int64_t utc_ns,
                                      std::vector<std::byte>& out) {
  if (explained_.size() >= kMaxExplained || name.size() > kMaxNameBytes) return;
  if (std::find(explained_.begin(), explained_.end(), name) != explained_.end()) return;
  // A client prints only texts of a sender it watches: the name gets an id at the end of the table,
  // on this connection only. No pong: the client rightly reports that there is no such body.
  const auto id =
      static_cast<std::int32_t>(static_cast<std::size_t>(kMaxIds) - 1 - explained_.size());
  if (static_cast<std::size_t>(id) < senders_.names().size()) return;
  explained_.push_back(name);
  const std::string text = "no body of this name here; there are: " + body_list();
  encode_description({utc_ns, id, kSenderDescription, 0}, name, out);
  encode_text(header_of(utc_ns, id, Type::kText), {Severity::kWarning, 0, text}, out);
  note(log::Level::kWarning,
       "asks for the body \"" + printable(name) + "\"; there are: " + body_list());
}

std::string Connection::body_list() const {
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

Session::Session(std::shared_ptr<SessionContext> context, net::Socket socket, Origin origin)
    : TcpSession(std::move(socket), "vrpn", context->clock),
      context_(std::move(context)),
      origin_(origin),
      connection_(context_->config, context_->senders, origin) {}

void Session::start() {
  replies() = connection_.greeting();
  TcpSession::start();
}

void Session::received(std::span<const std::byte> bytes) {
  const bool was_open = connection_.open();
  const std::size_t before = replies().size();
  const Instant now = clock().now();
  const auto result = connection_.receive(bytes, context_->utc_ns(now), replies());
  for (const auto& note : connection_.take_notes())
    log::write(note.level, "vrpn", transport_text() + " " + note.text);
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  number_messages(std::span(replies()).subspan(before), context_->sequence);
  if (!was_open && connection_.open()) {
    open_since_ = now;
    log::info("vrpn",
              "client " + transport_text() +
                  (origin_ == Origin::kDirect ? " connected" : " connected on its request"));
  }
  flush();
}

void Session::describe_new_senders() {
  if (!open()) return;
  const std::size_t before = replies().size();
  connection_.describe_new_senders(context_->utc_ns(clock().now()), replies());
  number_messages(std::span(replies()).subspan(before), context_->sequence);
  flush();
}

void Session::ticked(Instant now) {
  if (!open() && now - since() > kCookieTime) close("is closed: sent no VRPN cookie within 5 s");
}

ClientStatus Session::status(Instant now) const {
  const auto& config = context_->config;
  std::string detail = std::string(name_of(config.up)) + " m";
  detail += config.velocity ? ", velocity on" : ", velocity off";
  detail += config.acceleration ? ", acceleration on" : ", acceleration off";
  return {"vrpn",
          transport_text(),
          detail,
          frames_sent() + datagrams.frames_sent(),
          frames_dropped() + datagrams.frames_dropped(),
          to_seconds(now - open_since_.value_or(since()))};
}

std::string Session::transport_text() const {
  return net::text_of(peer()) + (udp_port() ? " udp" : " tcp");
}

}  // namespace fiducap::vrpn
