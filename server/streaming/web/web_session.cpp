#include "streaming/web/web_session.hpp"

#include <algorithm>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>

#include "base/log.hpp"
#include "base/text.hpp"
#include "streaming/conventions/text_fields.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/net/interfaces.hpp"
#include "streaming/web/beast_session.hpp"

namespace fiducap::web {

namespace {

using namespace std::chrono_literals;

constexpr std::size_t kLingerLimit = 1u << 20;
constexpr auto kRequestTimeout = 15s;
constexpr auto kResponseTimeout = 10s;
constexpr auto kLingerTimeout = 2s;
constexpr Duration kPause = 1s;     // no reading after too many requests
constexpr double kUpgradeCost = 4;  // a new page is sent all messages at once
constexpr const char* kSetupHeader = "X-Fiducap-Setup";

}  // namespace

BeastSession::BeastSession(net::Socket socket, const net::Peer& peer,
                           std::shared_ptr<WebContext> context)
    : WebSession(peer), stream_(std::move(socket->asio)), context_(std::move(context)) {}

void BeastSession::tick(Instant now) {
  if (paused_until_ && now >= *paused_until_) {
    paused_until_.reset();
    read_request();
  }
  if (control_ && !control_->is_alive(now)) return end();
  if (reader_ && !live_ && !reader_->is_alive(now)) return end();
  const bool is_old = (live_ || view_) && tokens_at_ != context_->tokens_changed();
  if (is_old && context_->reading_needs_proof()) return end();
  if (view_ && !view_->is_alive(now)) return end();
  pump();
}

void BeastSession::pause() { paused_until_ = context_->now() + kPause; }

void BeastSession::read_request() {
  parser_.emplace();
  parser_->header_limit(kHeaderLimit);
  tcp().expires_after(kRequestTimeout);
  http::async_read(tcp(), buffer_, *parser_, on(&BeastSession::on_request));
}

void BeastSession::on_request(ErrorCodeOf error, std::size_t) {
  if (error) return refuse(error);
  const auto& request = parser_->get();
  const auto socket =
      websocket::is_upgrade(request) ? socket_at(path_of(view_of(request.target()))) : std::nullopt;
  const bool is_watching = socket && *socket != SocketKind::kControl;
  // No limit for the set-up: other programs of this machine share its address.
  const bool leads = context_->leads_setup(view_of(request[kSetupHeader]));
  if (!leads && !context_->take_request(peer(), is_watching ? kUpgradeCost : 1))
    return send(later_response(429, "too many requests from this address; try again later\n"),
                request.keep_alive());
  // RFC 9112 3.2
  const auto hosts = request.count(http::field::host);
  if (hosts > 1 || (hosts == 0 && request.version() >= 11))
    return send(plain_response(400, "expected one Host\n"), false);
  if (!context_->knows(view_of(request[http::field::host])))
    return send(plain_response(421,
                               "this server has another name: use its address, or add this name to "
                               "streaming.web.hosts\n"),
                false);
  if (socket) return upgrade(*socket);
  const std::string address = net::text_of(peer());
  const HttpRequest asked{view_of(request.method_string()),
                          view_of(request.target()),
                          view_of(request[http::field::if_none_match]),
                          view_of(request[http::field::accept_encoding]),
                          view_of(request[http::field::accept]),
                          view_of(request[kSetupHeader]),
                          address};
  const bool for_another = is_forwarded();
  if (is_setup(path_of(asked.target))) {
    if (!is_own_page())
      return send(plain_response(403, "the set-up serves its own page only\n"), false);
    return send(context_->answer_setup(asked, peer(), for_another), request.keep_alive());
  }
  if (!is_open(path_of(asked.target))) {
    auto refusal = context_->refusal_to_read(view_of(request[http::field::authorization]), peer());
    if (refusal) return send(std::move(*refusal), request.keep_alive());
  }
  send(context_->answer(asked, context_->view_access(peer(), for_another)), request.keep_alive());
}

void BeastSession::refuse(ErrorCodeOf error) {
  (void)context_->take_request(peer(), 1);  // costs as much as a valid one
  if (error == http::error::header_limit || error == http::error::buffer_overflow)
    return send(plain_response(431, "request header larger than 8 KiB\n"), false);
  if (error == http::error::unexpected_body)
    return send(plain_response(413, "expected no body\n"), false);
  // Other errors of the parser: not HTTP. The rest are disconnects and timeouts, without a reply.
  const bool malformed =
      error.category() == http::make_error_code(http::error::bad_method).category() &&
      error != http::error::end_of_stream && error != http::error::partial_message;
  if (malformed) return send(plain_response(400, "not an HTTP request\n"), false);
  end();
}

void BeastSession::send(HttpResponse response, bool keep_alive) {
  body_ = response.body();
  const bool without_body = parser_->get().method() == http::verb::head || response.status == 304;
  response_.emplace(static_cast<http::status>(response.status), 11);
  response_->set(http::field::content_type, response.content_type);
  response_->set(http::field::cache_control, response.cache_control);
  if (response.content.gzip) response_->set(http::field::vary, "Accept-Encoding");
  if (response.gzip) response_->set(http::field::content_encoding, "gzip");
  if (response.retry_after_s > 0)
    response_->set(http::field::retry_after, std::to_string(response.retry_after_s));
  if (!response.etag.empty()) response_->set(http::field::etag, response.etag);
  if (response.status == 401) response_->set(http::field::www_authenticate, "Bearer");
  if (response.status == 405) response_->set(http::field::allow, "GET, HEAD");
  response_->set("Content-Security-Policy",
                 beast::string_view(kContentSecurityPolicy.data(), kContentSecurityPolicy.size()));
  response_->set("X-Content-Type-Options", "nosniff");
  response_->set("Referrer-Policy", "no-referrer");
  if (response.status != 304) response_->content_length(body_->size());
  response_->keep_alive(keep_alive);
  if (!without_body) response_->body() = {body_->data(), body_->size()};
  tcp().expires_after(kResponseTimeout);
  http::async_write(tcp(), *response_, on(&BeastSession::on_sent));
}

void BeastSession::on_sent(ErrorCodeOf error, std::size_t) {
  if (error) return end();
  if (response_->keep_alive()) {
    const bool too_many = response_->result() == http::status::too_many_requests;
    return too_many ? pause() : read_request();
  }
  tcp().socket().shutdown(asio::ip::tcp::socket::shutdown_send, error);
  tcp().expires_after(kLingerTimeout);
  linger();
}

// Closing with unread bytes would reset the connection before the reply is read: reads the rest.
void BeastSession::linger() {
  buffer_.clear();
  tcp().async_read_some(buffer_.prepare(kHeaderLimit), on(&BeastSession::on_lingered));
}

void BeastSession::on_lingered(ErrorCodeOf error, std::size_t bytes) {
  lingered_ += bytes;
  if (error || lingered_ > kLingerLimit) return end();
  linger();
}

void BeastSession::leave_places() {
  if (live_) context_->feed().leave(*std::exchange(live_, nullptr));
  if (view_) context_->view_feed().leave(*std::exchange(view_, nullptr));
  context_->end_control(*this);
}

void BeastSession::close(std::string_view why, log::Level level) {
  if (!close_once()) return;
  // Browsers open and close connections all the time.
  if (level >= log::Level::kWarning)
    log::write(level, "web", net::text_of(peer()) + " tcp " + std::string(why));
  leave_places();
  tcp().close();
}

std::vector<std::string> own_names(const WebConfig& config) {
  std::vector<std::string> names = config.hosts;
  names.push_back(net::host_name());
  return names;
}

std::shared_ptr<ViewConnection> WebContext::join_views(const net::Peer& peer, bool is_forwarded) {
  const ViewAccess access = view_access(peer, is_forwarded);
  const bool may_look = access.kind == ViewAccess::Kind::kGranted;
  if (access.kind == ViewAccess::Kind::kDenied || (may_look && !view_feed_.has_place(peer)))
    return nullptr;
  std::unique_ptr<native::ControlConversation> proof;
  if (access.kind == ViewAccess::Kind::kProof) proof = begin_proof(peer, access.for_readers);
  return view_feed_.join(peer, now(), std::move(proof));
}

std::unique_ptr<native::ControlConversation> WebContext::begin_control(WebSession& session) {
  if (operators_ == nullptr) return nullptr;
  std::vector<net::Peer> holders;
  for (const WebSession* one : controls_) holders.push_back(one->peer());
  const net::Place place = net::place_for(session.peer(), holders, kMostControls);
  if (!place.is_there) return nullptr;
  if (place.instead_of) {
    const auto other = std::find_if(
        controls_.rbegin(), controls_.rend(),
        [&](const WebSession* one) { return one->peer().same_address(*place.instead_of); });
    (*other)->close("is closed: another operator needs its place", log::Level::kInfo);
  }
  controls_.push_back(&session);
  return begin_proof(session.peer(), false);
}

std::unique_ptr<native::ControlConversation> WebContext::begin_proof(const net::Peer& peer,
                                                                     bool reads_only) {
  return std::make_unique<native::ControlConversation>(
      native::random_challenge(), *operators_, wrong_,
      native::ControlClient{hash(peer), {"web", kOperatorRight, net::text_of(peer)}, reads_only});
}

std::optional<HttpResponse> WebContext::refusal_to_read(std::string_view authorization,
                                                        const net::Peer& peer) {
  constexpr std::string_view kScheme = "Bearer ";
  if (!reading_needs_proof()) return std::nullopt;
  const HttpResponse refusal = plain_response(
      401, "this needs the server's token for reading: Authorization: Bearer TOKEN\n");
  if (!same_word(authorization.substr(0, kScheme.size()), kScheme)) return refusal;
  const std::string_view given = authorization.substr(kScheme.size());
  const bool has_ticket = std::ranges::any_of(
      feed_.connections(), [&](const auto& page) { return same_secret(given, page->ticket()); });
  if (has_ticket) return std::nullopt;
  if (wrong_.shut_out(hash(peer), now()))
    return later_response(429, "too many wrong tokens from this address: wait 10 s\n");
  if (same_secret(given, operators_->read_token())) return std::nullopt;
  wrong_.note(hash(peer), now());
  operators_->note_refusal({"web", {}, net::text_of(peer)}, "prove a token", "wrong token");
  return refusal;
}

std::shared_ptr<WebSession> make_session(net::Socket socket, const net::Peer& peer,
                                         std::shared_ptr<WebContext> context) {
  return std::make_shared<BeastSession>(std::move(socket), peer, std::move(context));
}

}  // namespace fiducap::web
