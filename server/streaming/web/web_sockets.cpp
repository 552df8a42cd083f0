// What a request may become: a socket that speaks, one that takes commands, or one with pictures.
#include <boost/beast/http/field.hpp>
#include <utility>

#include "base/log.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/web/beast_session.hpp"

namespace fiducap::web {

namespace {

using namespace std::chrono_literals;

constexpr Duration kReaderPatience = 5s;
// Small, so that a page that stopped reading shows after a few frames instead of after megabytes in
// the kernel.
constexpr int kSendBuffer = 256 * 1024;
constexpr std::size_t kLongestClientMessage = 1024;
constexpr std::size_t kLongestReason = 120;  // RFC 6455 5.5: 125 bytes with the code
constexpr const char* kTooManyViewers =
    "too many watch cameras already; close one of the pages that do";
constexpr std::size_t kLongestCommand = 8192;  // an alignment by 200 tags

}  // namespace

std::optional<BeastSession::SocketKind> BeastSession::socket_at(std::string_view path) {
  if (path == kLivePath) return SocketKind::kLive;
  if (path == kControlPath) return SocketKind::kControl;
  if (path == kViewsPath) return SocketKind::kViews;
  return std::nullopt;
}

/// A proxy says whom it asks for.
bool BeastSession::speaks_for_another() const {
  const auto& request = parser_->get();
  return request.find(http::field::forwarded) != request.end() ||
         request.find("X-Forwarded-For") != request.end() ||
         request.find("X-Real-IP") != request.end();
}

/// A page of this server asks, or a program that is no browser.
bool BeastSession::is_own_page() const {
  const auto& request = parser_->get();
  return request.count(http::field::origin) <= 1 &&
         same_origin(view_of(request[http::field::origin]), view_of(request[http::field::host]));
}

/// @return nullopt: welcome
std::optional<HttpResponse> BeastSession::refusal_of(SocketKind kind) {
  const auto& request = parser_->get();
  if (!is_own_page()) return plain_response(403, "the sockets serve their own page only\n");
  if (kind == SocketKind::kControl && !desk_->takes_commands())
    return plain_response(404, "nobody takes commands here\n");
  if (kind == SocketKind::kLive && !desk_->has_room(peer()))
    return later_response(503, "too many live pages; try again later\n");
  if (kind == SocketKind::kViews) {
    const ViewAccess access = desk_->view_access(peer(), speaks_for_another());
    if (access.kind == ViewAccess::Kind::kDenied) return plain_response(403, access.why + "\n");
    const bool may_look = access.kind == ViewAccess::Kind::kGranted;
    if (may_look && !desk_->view_feed().has_room(peer()))
      return later_response(503, std::string(kTooManyViewers) + "\n");
  }
  if (buffer_.size() != 0)
    return plain_response(400, "expected nothing before the upgrade's answer\n");
  return std::nullopt;
}

void BeastSession::upgrade(SocketKind kind) {
  if (auto refusal = refusal_of(kind)) return send(std::move(*refusal), false);
  tcp().expires_never();
  websocket::stream_base::timeout timeout{};
  timeout.handshake_timeout = 10s;  // and for a close
  timeout.idle_timeout = 30s;
  timeout.keep_alive_pings = true;
  stream_.set_option(timeout);
  stream_.read_message_max(kind == SocketKind::kControl ? kLongestCommand : kLongestClientMessage);
  const auto done = kind == SocketKind::kLive      ? &BeastSession::on_upgraded
                    : kind == SocketKind::kControl ? &BeastSession::on_control_upgraded
                                                   : &BeastSession::on_views_upgraded;
  stream_.async_accept(parser_->get(), on(done));
}

void BeastSession::on_upgraded(ErrorCodeOf error) {
  // Another page may have taken the last place during the handshake.
  if (!error) live_ = desk_->join(peer());
  if (!live_) return end();
  tcp().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer), error);
  tcp().socket().set_option(asio::ip::tcp::no_delay(true), error);
  stream_.text(true);
  stream_.auto_fragment(false);
  stream_.async_read(buffer_, on(&BeastSession::on_live_read));
  pump();
}

// The socket only speaks. Reading is for pings and the close; a page that talks is not ours.
void BeastSession::on_live_read(ErrorCodeOf, std::size_t) { end(); }

void BeastSession::pump() {
  if (view_) return pump_views();
  if (!live_) return;
  const Instant now = desk_->now();
  if (live_->dismissed())
    return close("is closed: its address has the most pages and others want one",
                 log::Level::kWarning);
  if (live_->stuck(now, kReaderPatience)) {
    return close("stopped reading and was closed", log::Level::kWarning);
  }
  Message message = live_->next(now);
  if (!message) return;
  writing_ = std::move(message);
  stream_.async_write(asio::buffer(*writing_), on(&BeastSession::on_live_written));
}

void BeastSession::on_live_written(ErrorCodeOf error, std::size_t) {
  if (error || !live_) return end();
  live_->written();
  pump();
}

void BeastSession::on_control_upgraded(ErrorCodeOf error) {
  if (!error) control_ = desk_->begin_control(*this);
  if (!control_) return end();
  stream_.binary(true);
  control_->greet(replies_, desk_->now());
  say_replies();
}

// The next one is read when the answer to this one has left: nothing waits here.
void BeastSession::on_command(ErrorCodeOf error, std::size_t) {
  if (error || !desk_->take_request(peer(), 1)) return end();
  const auto heard = buffer_.cdata();
  hangs_up_ = !control_->receive({static_cast<const std::byte*>(heard.data()), heard.size()},
                                 replies_, desk_->now());
  buffer_.clear();
  if (replies_.empty() && !hangs_up_) return on_replied({}, 0);  // half a request
  say_replies();
}

void BeastSession::say_replies() {
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_replied));
}

void BeastSession::on_replied(ErrorCodeOf error, std::size_t) {
  replies_.clear();
  if (error) return end();
  if (hangs_up_)
    return stream_.async_close(websocket::close_code::normal, on(&BeastSession::end_of));
  stream_.async_read(buffer_, on(&BeastSession::on_command));
}

void BeastSession::on_views_upgraded(ErrorCodeOf error) {
  if (!error) view_ = desk_->join_views(peer(), speaks_for_another());
  if (!view_) return end();
  tcp().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer), error);
  tcp().socket().set_option(asio::ip::tcp::no_delay(true), error);
  stream_.binary(true);
  stream_.auto_fragment(false);
  view_->greet(replies_, desk_->now());
  if (replies_.empty()) return stream_.async_read(buffer_, on(&BeastSession::on_wish));
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_view_reply));
}

// Text is a wish, anything else proves that the token is known.
void BeastSession::on_wish(ErrorCodeOf error, std::size_t) {
  if (error || !desk_->take_request(peer(), 1)) return end();
  if (!view_->is_admitted()) return prove_view();
  const auto heard = buffer_.cdata();
  const std::string_view text(static_cast<const char*>(heard.data()), heard.size());
  const auto wishes = stream_.got_text() ? parse_wishes(text)
                                         : fail(ErrorCode::kInvalid, "expected a wish as text");
  if (!wishes) {
    leave_places();
    const websocket::close_reason why(websocket::close_code::policy_error,
                                      wishes.error().what.substr(0, kLongestReason));
    return stream_.async_close(why, on(&BeastSession::end_of));
  }
  desk_->view_feed().wish(*view_, *wishes);
  buffer_.clear();
  stream_.async_read(buffer_, on(&BeastSession::on_wish));
}

void BeastSession::prove_view() {
  const auto heard = buffer_.cdata();
  hangs_up_ = stream_.got_text() ||
              !view_->prove({static_cast<const std::byte*>(heard.data()), heard.size()}, replies_,
                            desk_->now());
  buffer_.clear();
  if (view_->is_admitted() && !desk_->view_feed().admit(*view_)) {
    leave_places();
    const websocket::close_reason why(websocket::close_code::try_again_later, kTooManyViewers);
    return stream_.async_close(why, on(&BeastSession::end_of));
  }
  if (replies_.empty()) return on_view_reply({}, 0);  // half a request, or none at all
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_view_reply));
}

void BeastSession::on_view_reply(ErrorCodeOf error, std::size_t) {
  replies_.clear();
  if (error) return end();
  if (hangs_up_) {
    leave_places();
    return stream_.async_close(websocket::close_code::policy_error, on(&BeastSession::end_of));
  }
  stream_.async_read(buffer_, on(&BeastSession::on_wish));
}

void BeastSession::pump_views() {
  const Instant now = desk_->now();
  if (view_->dismissed())
    return close("is closed: its address has the most viewers and others want one",
                 log::Level::kWarning);
  if (view_->is_stuck(now, kReaderPatience))
    return close("stopped reading camera views and was closed", log::Level::kWarning);
  Message message = view_->next(now);
  if (!message) return;
  writing_ = std::move(message);
  stream_.async_write(asio::buffer(*writing_), on(&BeastSession::on_view_written));
}

void BeastSession::on_view_written(ErrorCodeOf error, std::size_t) {
  if (error || !view_) return end();
  view_->written();
  pump();
}

}  // namespace fiducap::web
