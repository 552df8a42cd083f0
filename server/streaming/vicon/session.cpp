#include "streaming/vicon/session.hpp"

#include <algorithm>
#include <utility>

namespace fiducap::vicon {

namespace {

constexpr std::uint32_t kMostNextFrames = 1000;

}  // namespace

std::vector<std::byte> Connection::greeting() {
  greeted_ = true;
  std::vector<std::byte> bytes;
  encode_greeting(bytes);
  return bytes;
}

Expected<void> Connection::receive(std::span<const std::byte> bytes, Instant now,
                                   std::vector<std::byte>& out) {
  in_.insert(in_.end(), bytes.begin(), bytes.end());
  std::size_t used = 0;
  for (;;) {
    const auto rest = std::span<const std::byte>(in_).subspan(used);
    const auto size = packet_size(rest);
    if (!size) return tl::unexpected(size.error());
    if (*size == 0 || rest.size() < *size) break;
    if (const auto taken = take_packet(rest.subspan(kHeaderSize, *size - kHeaderSize), out); !taken)
      return taken;
    used += *size;
  }
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
  if (open() && in_.empty()) {
    waiting_since_.reset();
  } else if (!waiting_since_ || (used > 0 && open())) {
    waiting_since_ = now;
  }
  return {};
}

Expected<void> Connection::take_packet(std::span<const std::byte> objects,
                                       std::vector<std::byte>& out) {
  while (!objects.empty()) {
    const auto object = take_object(objects);
    if (!object) return tl::unexpected(object.error());
    if (const auto taken = take(*object, out); !taken) return taken;
  }
  return {};
}

Expected<void> Connection::take(const Object& object, std::vector<std::byte>& out) {
  const auto use_value = [](auto decoded, auto&& consume) -> Expected<void> {
    if (!decoded) return tl::unexpected(decoded.error());
    consume(std::move(*decoded));
    return {};
  };
  switch (static_cast<Type>(object.type)) {
    case Type::kObjectEnums:
      return use_value(decode_object_enums(object.payload), [&](TypeSet types) {
        use({types, profile_ ? profile_->filter : early_filter_});
      });
    case Type::kRequestFrame:
      return use_value(decode_request_frame(object.payload), [&](bool streaming) {
        streaming_ = streaming;
        pull_ = !streaming;
        mode_ = streaming ? Mode::kPush : Mode::kPull;
      });
    case Type::kRequestNextFrame:
      return use_value(decode_request_next_frame(object.payload), [&](std::uint32_t n) {
        next_ = std::max(next_, std::min(n, kMostNextFrames));
        mode_ = Mode::kPrefetch;
      });
    case Type::kPing:
      return use_value(decode_ping(object.payload), [&](std::uint64_t id) {
        if (greeted_) encode_pong(id, out);  // never before the greeting
      });
    case Type::kFilter:
      return use_value(decode_filter(object.payload), [&](SubjectFilter filter) {
        if (profile_) return use({profile_->types, std::move(filter)});
        early_filter_ = std::move(filter);
      });
    default:
      return {};  // haptics, keep-alive, multicast: not needed by current clients
  }
}

void Connection::use(Profile wanted) {
  profile_ = profiles_.share(std::move(wanted));
  statics_sent_.reset();
}

bool Connection::wants(std::uint32_t id) const {
  return greeted_ && open() && (streaming_ || pull_ || next_ > 0) && last_sent_ != id;
}

void Connection::sent(std::uint32_t id, std::optional<std::uint64_t> statics_version) {
  last_sent_ = id;
  pull_ = false;
  if (next_ > 0) --next_;
  if (statics_version) statics_sent_ = statics_version;
}

std::optional<std::string> Connection::overdue(Instant now) const {
  if (!waiting_since_ || now - *waiting_since_ <= kSilence) return std::nullopt;
  return open() ? "is closed: sent only a part of a packet within 10 s"
                : "is closed: did not request data within 10 s";
}

std::string Connection::summary() const {
  static constexpr const char* kModes[] = {"silent", "pull", "prefetch", "push"};
  std::string text = kModes[static_cast<int>(mode_)];
  if (!open()) return text;
  const TypeSet& types = profile_->types;
  const bool full = types.has(Type::kGlobalSegments) || types.has(Type::kLocalSegments);
  text += full                                    ? ", segments"
          : types.has(Type::kLightweightSegments) ? ", lightweight segments"
                                                  : ", no poses";
  const Type shown = full ? Type::kGlobalSegments : Type::kLightweightSegments;
  if (const auto entry = profile_->filter.find(shown); entry != profile_->filter.end())
    text += ", " + std::to_string(entry->second.size()) + " subjects only";
  return text;
}

Session::Session(net::Socket socket, std::shared_ptr<SessionContext> context)
    : TcpSession(std::move(socket), "vicon", context->clock),
      context_(std::move(context)),
      connection_(context_->profiles, context_->clock.now()) {}

void Session::start() {
  TcpSession::start();
  if (!closed()) wake_after(kGreetingDelay);
}

void Session::woken() {
  send(connection_.greeting());
  publish();  // it may have requested one already
}

void Session::received(std::span<const std::byte> bytes) {
  const bool was_open = open();
  const auto result = connection_.receive(bytes, clock().now(), replies());
  if (!result) return close("is refused: " + result.error().text(), log::Level::kWarning);
  if (!was_open && open()) log::info("vicon", "client " + peer_text() + " connected");
  publish();
}

void Session::publish() {
  FrameBoard& board = context_->board;
  if (closed() || board.empty() || !connection_.wants(board.id())) return;
  // A waiting frame is dropped for this one; its static objects must not be lost.
  const bool statics = connection_.wants_statics(board.statics_version()) ||
                       (statics_in_last_frame_ && frame_waits());
  offer(board.packet(connection_.profile(), statics, clock().now()));
  statics_in_last_frame_ = statics;
  connection_.sent(board.id(), statics ? std::optional(board.statics_version()) : std::nullopt);
}

void Session::ticked(Instant now) {
  if (const auto why = connection_.overdue(now)) close(*why);
}

ClientStatus Session::status(Instant now) const {
  return {"vicon",       peer_text(),      "z-up mm, " + connection_.summary(),
          frames_sent(), frames_dropped(), to_seconds(now - since())};
}

}  // namespace fiducap::vicon
