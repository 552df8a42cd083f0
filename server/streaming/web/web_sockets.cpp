// The WebSockets: frames for live pages, commands, pictures of cameras.
#include <boost/beast/http/field.hpp>
#include <utility>

#include "base/log.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/web/beast_session.hpp"

namespace fiducap::web {

namespace {

using namespace std::chrono_literals;

constexpr Duration kWriteTimeout = 5s;
// Small, so that a page that stopped reading is found after a few frames.
constexpr int kSendBuffer = 256 * 1024;
constexpr std::size_t kLongestClientMessage = 1024;
constexpr std::size_t kLongestReason = 120;  // RFC 6455 5.5: 125 bytes with the code
constexpr const char* kTooManyViewers = "too many pages show cameras; close one of them";
constexpr std::size_t kLongestCommand = 8192;  // an alignment by 200 tags

}  // namespace

std::optional<BeastSession::SocketKind> BeastSession::socket_at(std::string_view path) {
  if (path == kLivePath) return SocketKind::kLive;
  if (path == kControlPath) return SocketKind::kControl;
  if (path == kViewsPath) return SocketKind::kViews;
  return std::nullopt;
}

/// Proxies add one of these headers.
bool BeastSession::is_forwarded() const {
  const auto& request = parser_->get();
  return request.find(http::field::forwarded) != request.end() ||
         request.find("X-Forwarded-For") != request.end() ||
         request.find("X-Real-IP") != request.end();
}

/// From a page of this server, or from a program other than a browser.
bool BeastSession::is_own_page() const {
  const auto& request = parser_->get();
  return request.count(http::field::origin) <= 1 &&
         same_origin(view_of(request[http::field::origin]), view_of(request[http::field::host]));
}

/// @return nullopt: accepted
std::optional<HttpResponse> BeastSession::refusal_of(SocketKind kind) {
  if (!is_own_page()) return plain_response(403, "the sockets serve their own page only\n");
  if (kind == SocketKind::kControl && !context_->takes_commands())
    return plain_response(404, "this server takes no commands\n");
  const bool proves_first = context_->reading_needs_proof();
  if (kind == SocketKind::kLive && !proves_first && !context_->has_place(peer()))
    return later_response(503, "too many live pages; try again later\n");
  if (kind == SocketKind::kViews) {
    const ViewAccess access = context_->view_access(peer(), is_forwarded());
    if (access.kind == ViewAccess::Kind::kDenied) return plain_response(403, access.why + "\n");
    const bool may_look = access.kind == ViewAccess::Kind::kGranted;
    if (may_look && !context_->view_feed().has_place(peer()))
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
  if (error) return end();
  tokens_at_ = context_->tokens_changed();
  if (!context_->reading_needs_proof()) return join_live();
  reader_ = context_->begin_proof(peer(), true);
  stream_.binary(true);
  reader_->greet(replies_, context_->now());
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_live_reply));
}

void BeastSession::on_live_proof(ErrorCodeOf error, std::size_t) {
  if (error || !context_->take_request(peer(), 1)) return end();
  hangs_up_ = stream_.got_text() || !reader_->receive(received(), replies_, context_->now());
  buffer_.clear();
  if (replies_.empty()) return on_live_reply({}, 0);  // half a request, or none at all
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_live_reply));
}

void BeastSession::on_live_reply(ErrorCodeOf error, std::size_t) {
  replies_.clear();
  if (error) return end();
  if (hangs_up_) return close_socket(websocket::close_code::policy_error);
  if (reader_->is_admitted()) return join_live();
  stream_.async_read(buffer_, on(&BeastSession::on_live_proof));
}

void BeastSession::join_live() {
  // The last place may have been taken meanwhile.
  live_ = context_->join(peer());
  if (!live_) return end();
  if (reader_) live_->give_ticket();
  tune_socket(true);
  stream_.async_read(buffer_, on(&BeastSession::on_live_read));
  pump();
}

// Only for pings and the close; pages send no messages.
void BeastSession::on_live_read(ErrorCodeOf, std::size_t) { end(); }

template <class Client>
void BeastSession::write_next(Client& client, std::string_view places) {
  const Instant now = context_->now();
  if (client.dismissed())
    return close("is closed: its address has the most " + std::string(places) +
                     " and another client needs one",
                 log::Level::kWarning);
  if (client.is_stuck(now, kWriteTimeout))
    return close("stopped reading and was closed", log::Level::kWarning);
  Message message = client.next(now);
  if (!message) return;
  writing_ = std::move(message);
  stream_.async_write(asio::buffer(*writing_), on(&BeastSession::on_written));
}

void BeastSession::pump() {
  if (view_) return write_next(*view_, "viewers");
  if (live_) write_next(*live_, "pages");
}

void BeastSession::on_written(ErrorCodeOf error, std::size_t) {
  if (error || (!live_ && !view_)) return end();
  live_ ? live_->written() : view_->written();
  pump();
}

std::span<const std::byte> BeastSession::received() const {
  return {static_cast<const std::byte*>(buffer_.cdata().data()), buffer_.size()};
}

// For frames and pictures: binary or text messages of one fragment.
void BeastSession::tune_socket(bool text) {
  ErrorCodeOf ignored;
  tcp().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
  tcp().socket().set_option(asio::ip::tcp::no_delay(true), ignored);
  stream_.text(text);
  stream_.auto_fragment(false);
}

void BeastSession::close_socket(const websocket::close_reason& reason) {
  leave_places();
  stream_.async_close(reason, on(&BeastSession::end_of));
}

void BeastSession::on_control_upgraded(ErrorCodeOf error) {
  if (!error) control_ = context_->begin_control(*this);
  if (!control_) return end();
  stream_.binary(true);
  control_->greet(replies_, context_->now());
  send_replies();
}

// The next one is read after the reply is written.
void BeastSession::on_command(ErrorCodeOf error, std::size_t) {
  if (error || !context_->take_request(peer(), 1)) return end();
  hangs_up_ = !control_->receive(received(), replies_, context_->now());
  buffer_.clear();
  if (replies_.empty() && !hangs_up_) return on_replied({}, 0);  // half a request
  send_replies();
}

void BeastSession::send_replies() {
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
  tokens_at_ = context_->tokens_changed();
  if (!error) view_ = context_->join_views(peer(), is_forwarded());
  if (!view_) return end();
  tune_socket(false);
  view_->greet(replies_, context_->now());
  if (replies_.empty()) return stream_.async_read(buffer_, on(&BeastSession::on_view_request));
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_view_reply));
}

// Text is a request for cameras, binary data a proof of the token.
void BeastSession::on_view_request(ErrorCodeOf error, std::size_t) {
  if (error || !context_->take_request(peer(), 1)) return end();
  if (!view_->is_admitted()) return prove_view();
  const auto bytes = received();
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const auto requests = stream_.got_text()
                            ? parse_view_requests(text)
                            : fail(ErrorCode::kInvalid, "expected a request as text");
  if (!requests)
    return close_socket(
        {websocket::close_code::policy_error, requests.error().what.substr(0, kLongestReason)});
  context_->view_feed().request(*view_, *requests);
  buffer_.clear();
  stream_.async_read(buffer_, on(&BeastSession::on_view_request));
}

void BeastSession::prove_view() {
  hangs_up_ = stream_.got_text() || !view_->prove(received(), replies_, context_->now());
  buffer_.clear();
  if (view_->is_admitted() && !context_->view_feed().admit(*view_))
    return close_socket({websocket::close_code::try_again_later, kTooManyViewers});
  if (replies_.empty()) return on_view_reply({}, 0);  // half a request, or none at all
  stream_.async_write(asio::buffer(replies_), on(&BeastSession::on_view_reply));
}

void BeastSession::on_view_reply(ErrorCodeOf error, std::size_t) {
  replies_.clear();
  if (error) return end();
  if (hangs_up_) return close_socket(websocket::close_code::policy_error);
  stream_.async_read(buffer_, on(&BeastSession::on_view_request));
}

}  // namespace fiducap::web
