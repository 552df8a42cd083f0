#include "streaming/web/web_session.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>
#include <utility>

#include "base/log.hpp"

namespace fiducap::web {

namespace {

using namespace std::chrono_literals;
namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using ErrorCodeOf = boost::system::error_code;

constexpr std::uint32_t kHeaderLimit = 8192;
constexpr std::size_t kReadLimit = 2 * kHeaderLimit;
constexpr std::size_t kLingerLimit = 1u << 20;
constexpr auto kRequestTimeout = 15s;
constexpr auto kResponseTimeout = 30s;
constexpr auto kLingerTimeout = 2s;
constexpr Duration kReaderPatience = 5s;
// Small, so that a page that stopped reading shows after a few frames instead of after megabytes in
// the kernel.
constexpr int kSendBuffer = 256 * 1024;
constexpr std::size_t kLongestClientMessage = 1024;

std::string peer_text(const asio::ip::tcp::socket& socket) {
  ErrorCodeOf error;
  const auto peer = socket.remote_endpoint(error);
  if (error) return "gone";
  const std::string address = peer.address().to_string();
  return (peer.address().is_v6() ? "[" + address + "]" : address) + ":" +
         std::to_string(peer.port()) + " tcp";
}

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

}  // namespace

class WebSession final : public std::enable_shared_from_this<WebSession> {
 public:
  WebSession(asio::ip::tcp::socket socket, std::shared_ptr<WebDesk> desk)
      : stream_(std::move(socket)), desk_(std::move(desk)) {}
  ~WebSession() {
    if (live_) desk_->feed().leave(*live_);
  }

  void read_request();
  void pump();
  void close();

 private:
  using Response = http::response<http::span_body<const char>>;

  [[nodiscard]] beast::tcp_stream& tcp() { return stream_.next_layer(); }
  template <typename Handler>
  [[nodiscard]] auto on(Handler handler) {
    return [self = shared_from_this(), handler](ErrorCodeOf error, auto&&... rest) {
      (self.get()->*handler)(error, rest...);
    };
  }

  void on_request(ErrorCodeOf error, std::size_t bytes);
  void refuse(ErrorCodeOf error);
  void send(HttpResponse response, bool keep_alive);
  void on_sent(ErrorCodeOf error, std::size_t bytes);
  void linger();
  void on_lingered(ErrorCodeOf error, std::size_t bytes);
  void upgrade();
  void on_upgraded(ErrorCodeOf error);
  void on_live_read(ErrorCodeOf error, std::size_t bytes);
  void on_live_written(ErrorCodeOf error, std::size_t bytes);

  websocket::stream<beast::tcp_stream> stream_;
  std::shared_ptr<WebDesk> desk_;
  beast::flat_buffer buffer_{kReadLimit};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
  std::shared_ptr<const std::string> body_;
  std::shared_ptr<LiveConnection> live_;
  Message writing_;
  std::size_t lingered_{0};
};

void WebSession::read_request() {
  parser_.emplace();
  parser_->header_limit(kHeaderLimit);
  tcp().expires_after(kRequestTimeout);
  http::async_read(tcp(), buffer_, *parser_, on(&WebSession::on_request));
}

void WebSession::on_request(ErrorCodeOf error, std::size_t) {
  if (error) return refuse(error);
  const auto& request = parser_->get();
  if (websocket::is_upgrade(request) && path_of(view(request.target())) == kLivePath)
    return upgrade();
  send(desk_->answer({view(request.method_string()), view(request.target()),
                      view(request[http::field::if_none_match])}),
       request.keep_alive());
}

void WebSession::refuse(ErrorCodeOf error) {
  if (error == http::error::header_limit || error == http::error::buffer_overflow) {
    return send(plain_response(431, "request header larger than 8 KiB\n"), false);
  }
  if (error == http::error::unexpected_body)
    return send(plain_response(413, "expected no body\n"), false);
  // Anything else of the parser is not HTTP; the rest are ends and timeouts, which nobody waits to
  // hear about.
  const bool malformed =
      error.category() == http::make_error_code(http::error::bad_method).category() &&
      error != http::error::end_of_stream && error != http::error::partial_message;
  if (malformed) return send(plain_response(400, "not an HTTP request\n"), false);
  close();
}

void WebSession::send(HttpResponse response, bool keep_alive) {
  body_ = std::move(response.body);
  const bool without_body = parser_->get().method() == http::verb::head || response.status == 304;
  response_.emplace(static_cast<http::status>(response.status), 11);
  response_->set(http::field::content_type, response.content_type);
  response_->set(http::field::cache_control, response.cache_control);
  if (!response.etag.empty()) response_->set(http::field::etag, response.etag);
  if (response.status == 405) response_->set(http::field::allow, "GET, HEAD");
  response_->set("Content-Security-Policy",
                 beast::string_view(kContentSecurityPolicy.data(), kContentSecurityPolicy.size()));
  response_->set("X-Content-Type-Options", "nosniff");
  response_->set("Referrer-Policy", "no-referrer");
  if (response.status != 304) response_->content_length(body_->size());
  response_->keep_alive(keep_alive);
  if (!without_body) response_->body() = {body_->data(), body_->size()};
  tcp().expires_after(kResponseTimeout);
  http::async_write(tcp(), *response_, on(&WebSession::on_sent));
}

void WebSession::on_sent(ErrorCodeOf error, std::size_t) {
  if (error) return close();
  if (response_->keep_alive()) return read_request();
  tcp().socket().shutdown(asio::ip::tcp::socket::shutdown_send, error);
  tcp().expires_after(kLingerTimeout);
  linger();
}

// Closing on unread bytes would reset the connection and take the answer with it: the rest is read
// and forgotten.
void WebSession::linger() {
  buffer_.clear();
  tcp().async_read_some(buffer_.prepare(kHeaderLimit), on(&WebSession::on_lingered));
}

void WebSession::on_lingered(ErrorCodeOf error, std::size_t bytes) {
  lingered_ += bytes;
  if (error || lingered_ > kLingerLimit) return close();
  linger();
}

void WebSession::upgrade() {
  const auto& request = parser_->get();
  if (!same_origin(view(request[http::field::origin]), view(request[http::field::host]))) {
    return send(plain_response(403, "the live socket serves its own page only\n"), false);
  }
  if (!desk_->has_room())
    return send(plain_response(503, "too many live pages; try again later\n"), false);
  if (buffer_.size() != 0)
    return send(plain_response(400, "expected nothing before the upgrade's answer\n"), false);
  tcp().expires_never();
  websocket::stream_base::timeout timeout{};
  timeout.handshake_timeout = 10s;
  timeout.idle_timeout = 30s;
  timeout.keep_alive_pings = true;
  stream_.set_option(timeout);
  stream_.read_message_max(kLongestClientMessage);
  stream_.async_accept(request, on(&WebSession::on_upgraded));
}

void WebSession::on_upgraded(ErrorCodeOf error) {
  // Looked at again: another page may have taken the last place during the handshake.
  if (error || !desk_->has_room()) return close();
  tcp().socket().set_option(asio::socket_base::send_buffer_size(kSendBuffer), error);
  tcp().socket().set_option(asio::ip::tcp::no_delay(true), error);
  stream_.text(true);
  stream_.auto_fragment(false);
  live_ = desk_->feed().join(peer_text(tcp().socket()), desk_->now());
  stream_.async_read(buffer_, on(&WebSession::on_live_read));
  pump();
}

// The socket only speaks. Reading is for pings and the close; a page that talks is not ours.
void WebSession::on_live_read(ErrorCodeOf, std::size_t) { close(); }

void WebSession::pump() {
  if (!live_) return;
  const Instant now = desk_->now();
  if (live_->stuck(now, kReaderPatience)) {
    log::warning("web", live_->status(now).peer + " stopped reading and was closed");
    return close();
  }
  Message message = live_->next(now);
  if (!message) return;
  writing_ = std::move(message);
  stream_.async_write(asio::buffer(*writing_), on(&WebSession::on_live_written));
}

void WebSession::on_live_written(ErrorCodeOf error, std::size_t) {
  if (error || !live_) return close();
  live_->written();
  pump();
}

void WebSession::close() {
  if (live_) desk_->feed().leave(*std::exchange(live_, nullptr));
  tcp().close();
}

std::shared_ptr<WebSession> start_session(asio::ip::tcp::socket socket,
                                          std::shared_ptr<WebDesk> desk) {
  auto session = std::make_shared<WebSession>(std::move(socket), std::move(desk));
  session->read_request();
  return session;
}

void pump(WebSession& session) { session.pump(); }
void close(WebSession& session) { session.close(); }

}  // namespace fiducap::web
