#include "streaming/qualisys/session.hpp"

#include <utility>

#include "streaming/qualisys/xml.hpp"

namespace fiducap::qualisys {

namespace {

constexpr std::string_view kWelcome = "QTM RT Interface connected";
constexpr const char* kParseError = "Parse error";
// Limit of unread replies.
constexpr std::size_t kMaxAnswers = 4 << 20;
constexpr std::size_t kMaxPending = 16;
constexpr int kMaxWrongPasswords = 5;

// Every client sends its version at once.
constexpr Duration kSilence = std::chrono::seconds(10);

}  // namespace

bool FramePicker::wants(const SceneFrame& frame) {
  switch (rate_.kind) {
    case RateKind::kAllFrames:
      return true;
    case RateKind::kFrequencyDivisor:
      if (!first_) first_ = frame.number;
      return (frame.number - *first_) % rate_.n == 0;
    case RateKind::kFrequency:
      break;
  }
  // A schedule on the frames' clock: the nearest frames. Restarts after a pause.
  const Duration period{1'000'000'000 / rate_.n};
  const Duration half_a_frame{frame.rate_hz > 0 ? static_cast<std::int64_t>(0.5e9 / frame.rate_hz)
                                                : 0};
  if (due_ && frame.at + half_a_frame < *due_) return false;
  const bool late = !due_ || frame.at - *due_ > period;
  due_ = (late ? frame.at : *due_) + period;
  return true;
}

Connection::Connection(SharedState& shared, Dialect dialect, std::uint64_t id, std::string address,
                       std::uint16_t port)
    : shared_(shared),
      dialect_(dialect),
      order_(dialect == Dialect::kLittleEndian ? std::endian::little : std::endian::big),
      id_(id),
      address_(std::move(address)),
      port_(port),
      version_{dialect == Dialect::kLegacy ? 0 : 1} {}

void Connection::greet(std::vector<std::byte>& out) const {
  encode_text(order_, PacketType::kCommand, kWelcome, out);
}

Expected<void> Connection::receive(std::span<const std::byte> bytes, std::vector<std::byte>& out) {
  in_.insert(in_.end(), bytes.begin(), bytes.end());
  std::size_t used = 0;
  for (;;) {
    const auto packet = decode_packet(order_, std::span(in_).subspan(used));
    if (!packet) return tl::unexpected(packet.error());
    if (!*packet) break;
    handle(**packet, out);
    used += (*packet)->size;
    if (out.size() > kMaxAnswers) return fail(ErrorCode::kInvalid, "does not read its replies");
    if (wrong_passwords_ >= kMaxWrongPasswords)
      return fail(ErrorCode::kInvalid, "gave five wrong passwords");
  }
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
  return {};
}

void Connection::handle(const Packet& packet, std::vector<std::byte>& out) {
  has_spoken_ = true;
  if (packet.type == PacketType::kCommand)
    return obey(split_command(decode_text(packet.payload)), out);
  if (packet.type == PacketType::kXml)
    return reply(
        shared_.control.apply_settings(id_, decode_text(packet.payload), shared_.bodies.entries()),
        out);
  reply(Reply::refused(kParseError), out);
}

void Connection::obey(const Command& command, std::vector<std::byte>& out) {
  if (command.is("Version")) return set_version(command.rest, out);
  if (command.is("QTMVersion"))
    return reply(Reply::done("QTM Version is " + shared_.config.qtm_version), out);
  if (command.is("ByteOrder")) return byte_order(command.rest, out);
  if (command.is("CheckLicense")) return reply(Reply::done("License pass"), out);
  if (command.is("GetState") || command.is("GetLastEvent"))
    return append(shared_.control.state(), out);
  if (command.is("GetParameters")) return parameters(command.rest, out);
  if (command.is("GetCurrentFrame")) return current_frame(command.rest, out);
  if (command.is("StreamFrames")) return stream_frames(command.rest, out);
  if (command.is("TakeControl")) return take_control(command.rest, out);
  if (command.is("ReleaseControl")) return reply(shared_.control.release(id_), out);
  const auto done = shared_.control.execute(id_, command);
  reply(done ? *done : Reply::refused(kParseError), out);
}

void Connection::set_version(std::string_view word, std::vector<std::byte>& out) {
  if (word.empty())
    return reply(Reply::done("Version is 1." + std::to_string(version_.minor)), out);
  const auto version = parse_version(word);
  // 1.0 has its own port, without other versions.
  if (!version || (version->minor == 0) != (dialect_ == Dialect::kLegacy))
    return reply(Reply::refused("Version NOT supported"), out);
  version_ = *version;
  reply(Reply::done("Version set to 1." + std::to_string(version_.minor)), out);
}

void Connection::byte_order(std::string_view words, std::vector<std::byte>& out) {
  const bool big = order_ == std::endian::big;
  // Clients of 1.0 send the order; it must be that of the port.
  const bool other =
      (same_word(words, "BigEndian") && !big) || (same_word(words, "LittleEndian") && big);
  if (other) return reply(Reply::refused("Byte order is chosen by the port"), out);
  reply(Reply::done(big ? "Byte order is big endian" : "Byte order is little endian"), out);
}

void Connection::parameters(std::string_view words, std::vector<std::byte>& out) {
  const auto groups = parse_parameter_groups(words);
  if (!groups) return reply(Reply::refused(kParseError), out);
  encode_text(order_, PacketType::kXml,
              parameters_xml(*groups, version_, shared_.bodies.entries(), shared_.config.up,
                             shared_.rate_hz),
              out);
}

void Connection::current_frame(std::string_view words, std::vector<std::byte>& out) {
  const auto components = parse_components(words);
  if (!components) return reply(Reply::refused(kParseError), out);
  if (shared_.frames.number() == 0) return encode_no_more_data(order_, out);
  if (pending_.size() >= kMaxPending)
    return reply(Reply::refused("Too many frames are asked for"), out);
  pending_.push_back(*components);
}

void Connection::stream_frames(std::string_view words, std::vector<std::byte>& out) {
  if (same_word(split_command(words).name, "Stop")) return stream_.reset();
  auto request = parse_stream_request(words);
  if (!request) return reply(Reply::refused(kParseError), out);
  // A stream cannot be sent to a third party.
  if (!request->udp_address.empty() && request->udp_address != address_)
    return reply(Reply::refused("UDP goes to the client's own address only"), out);
  const FramePicker picker(request->rate);
  stream_.emplace(Stream{std::move(*request), picker});
  if (shared_.frames.number() == 0) encode_no_more_data(order_, out);
}

void Connection::take_control(std::string_view password, std::vector<std::byte>& out) {
  if (shared_.wrong_passwords.shut_out(address_hash(), shared_.now))
    return reply(Reply::refused("Too many wrong passwords from this address: wait 10 s"), out);
  const Reply taken =
      shared_.control.take(id_, address_ + " (" + std::to_string(port_) + ")", password);
  if (taken.wrong_password) {
    ++wrong_passwords_;
    shared_.wrong_passwords.note(address_hash(), shared_.now);
  }
  reply(taken, out);
}

/// Of the address: reconnecting does not reset the count.
std::uint64_t Connection::address_hash() const {
  return net::siphash(shared_.key,
                      {reinterpret_cast<const std::uint8_t*>(address_.data()), address_.size()});
}

void Connection::reply(const Reply& reply, std::vector<std::byte>& out) const {
  encode_text(order_, reply.ok ? PacketType::kCommand : PacketType::kError, reply.text, out);
}

std::optional<std::uint16_t> Connection::udp_port() const {
  return stream_ ? stream_->request.udp_port : std::nullopt;
}

std::optional<Profile> Connection::stream_of(const SceneFrame& frame) {
  if (!stream_ || !stream_->picker.wants(frame)) return std::nullopt;
  return profile_of(stream_->request.components);
}

std::optional<Profile> Connection::current_of(std::uint64_t frame_number) {
  if (pending_.empty() || frame_number <= answered_frame_) return std::nullopt;
  answered_frame_ = frame_number;
  const Profile profile = profile_of(pending_.front());
  pending_.pop_front();
  return profile;
}

Profile Connection::profile_of(Components components) const {
  return {components, order_, version_.wide()};
}

std::string Connection::detail() const {
  std::string text = "1." + std::to_string(version_.minor) + ", " +
                     std::string(name_of(shared_.config.up)) + " mm";
  if (shared_.control.is_master(id_)) text += ", master";
  if (!stream_) return text + ", no stream";
  for (const auto& known : kComponentWords)
    if (stream_->request.components.has(known.component)) text += " " + std::string(known.word);
  return text;
}

Session::Session(net::Socket socket, std::shared_ptr<SharedState> shared, Dialect dialect,
                 std::uint64_t id, const Clock& clock)
    : TcpSession(std::move(socket), "qualisys", clock),
      shared_(std::move(shared)),
      connection_(*shared_, dialect, id, net::address_text(peer()), peer().port) {}

void Session::start() {
  connection_.greet(replies());
  TcpSession::start();
}

void Session::send_event(Event event) {
  connection_.append(event, replies());
  flush();
}

void Session::received(std::span<const std::byte> bytes) {
  const auto result = connection_.receive(bytes, replies());
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  answer_current();
  flush();
}

void Session::answer_current() {
  const auto profile = connection_.current_of(shared_->frames.number());
  if (profile) send(shared_->frames.encoded(*profile)->packet);
}

void Session::ticked(Instant now) {
  if (!connection_.has_spoken() && now - since() > kSilence)
    close("is closed: sent nothing within 10 s");
}

ClientStatus Session::status(Instant now) const {
  return {"qualisys",
          peer_text() + (connection_.udp_port() ? " + udp" : ""),
          connection_.detail(),
          frames_sent() + datagrams.frames_sent(),
          frames_dropped() + datagrams.frames_dropped(),
          to_seconds(now - since())};
}

}  // namespace fiducap::qualisys
