#include "streaming/web/web_session.hpp"

#include <algorithm>
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
#include "streaming/net/bind.hpp"
#include "streaming/net/guard.hpp"
#include "streaming/net/interfaces.hpp"

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
constexpr auto kResponseTimeout = 10s;
constexpr auto kLingerTimeout = 2s;
constexpr Duration kReaderPatience = 5s;
// Who asks too much is read no further for a while: its refusals cost next to nothing, too.
constexpr Duration kPause = 1s;
constexpr double kUpgradeCost = 4;  // a new page is sent everything at once
// Small, so that a page that stopped reading shows after a few frames instead of after megabytes in
// the kernel.
constexpr int kSendBuffer = 256 * 1024;
constexpr std::size_t kLongestClientMessage = 1024;
constexpr std::size_t kLongestCommand = 8192;  // an alignment by 200 tags

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

class BeastSession final : public WebSession {
 public:
  BeastSession(net::Socket socket, const net::Peer& peer, std::shared_ptr<WebDesk> desk)
      : WebSession(peer), stream_(std::move(socket->asio)), desk_(std::move(desk)) {}
  ~BeastSession() override {
    if (live_) desk_->feed().leave(*live_);
    desk_->end_control(*this);
  }

  void start() override { desk_->may_ask(peer()) ? read_request() : pause(); }
  void tick(Instant now) override;
  void close(std::string_view why, log::Level level) override;
  void pump() override;

 private:
  using Response = http::response<http::span_body<const char>>;

  [[nodiscard]] beast::tcp_stream& tcp() { return stream_.next_layer(); }
  template <typename Handler>
  [[nodiscard]] auto on(Handler handler) {
    return [self = std::static_pointer_cast<BeastSession>(shared_from_this()), handler](
               ErrorCodeOf error, auto&&... rest) {
      if (self->closed()) return;
      const auto whose = [&] { return "client " + net::text_of(self->peer()); };
      if (!net::guarded("web", whose, [&] { (self.get()->*handler)(error, rest...); })) self->end();
    };
  }

  void read_request();
  void pause() { paused_until_ = desk_->now() + kPause; }
  void end_of(ErrorCodeOf) { end(); }
  void end() { close("left", log::Level::kDebug); }

  void on_request(ErrorCodeOf error, std::size_t bytes);
  void refuse(ErrorCodeOf error);
  void send(HttpResponse response, bool keep_alive);
  void on_sent(ErrorCodeOf error, std::size_t bytes);
  void linger();
  void on_lingered(ErrorCodeOf error, std::size_t bytes);
  void upgrade(bool to_control);
  void on_upgraded(ErrorCodeOf error);
  void on_live_read(ErrorCodeOf error, std::size_t bytes);
  void on_live_written(ErrorCodeOf error, std::size_t bytes);
  void on_control_upgraded(ErrorCodeOf error);
  void on_command(ErrorCodeOf error, std::size_t bytes);
  void say_replies();
  void on_replied(ErrorCodeOf error, std::size_t bytes);

  websocket::stream<beast::tcp_stream> stream_;
  std::shared_ptr<WebDesk> desk_;
  beast::flat_buffer buffer_{kReadLimit};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
  std::shared_ptr<const std::string> body_;
  std::shared_ptr<LiveConnection> live_;
  Message writing_;
  std::unique_ptr<native::ControlConversation> control_;
  std::vector<std::byte> replies_;
  bool hangs_up_{false};
  std::size_t lingered_{0};
  std::optional<Instant> paused_until_;
};

void BeastSession::tick(Instant now) {
  if (paused_until_ && now >= *paused_until_) {
    paused_until_.reset();
    read_request();
  }
  if (control_ && !control_->patient(now)) return end();
  pump();
}

void BeastSession::read_request() {
  parser_.emplace();
  parser_->header_limit(kHeaderLimit);
  tcp().expires_after(kRequestTimeout);
  http::async_read(tcp(), buffer_, *parser_, on(&BeastSession::on_request));
}

void BeastSession::on_request(ErrorCodeOf error, std::size_t) {
  if (error) return refuse(error);
  const auto& request = parser_->get();
  const bool upgrades = websocket::is_upgrade(request);
  const bool wants_live = upgrades && path_of(view(request.target())) == kLivePath;
  const bool wants_control = upgrades && path_of(view(request.target())) == kControlPath;
  if (!desk_->take_request(peer(), wants_live ? kUpgradeCost : 1)) {
    return send(later_response(429, "too many requests of this address; come again later\n"),
                request.keep_alive());
  }
  if (!desk_->knows(view(request[http::field::host]))) {
    return send(plain_response(421,
                               "this server has another name: use its address, or add this name to "
                               "streaming.web.hosts\n"),
                false);
  }
  if (wants_live || wants_control) return upgrade(wants_control);
  send(desk_->answer({view(request.method_string()), view(request.target()),
                      view(request[http::field::if_none_match]),
                      view(request[http::field::accept_encoding]),
                      view(request[http::field::accept])}),
       request.keep_alive());
}

void BeastSession::refuse(ErrorCodeOf error) {
  (void)desk_->take_request(peer(), 1);  // it cost us as much as a good one
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

// Closing on unread bytes would reset the connection and take the answer with it: the rest is read
// and forgotten.
void BeastSession::linger() {
  buffer_.clear();
  tcp().async_read_some(buffer_.prepare(kHeaderLimit), on(&BeastSession::on_lingered));
}

void BeastSession::on_lingered(ErrorCodeOf error, std::size_t bytes) {
  lingered_ += bytes;
  if (error || lingered_ > kLingerLimit) return end();
  linger();
}

void BeastSession::upgrade(bool to_control) {
  const auto& request = parser_->get();
  if (!same_origin(view(request[http::field::origin]), view(request[http::field::host]))) {
    return send(plain_response(403, "the sockets serve their own page only\n"), false);
  }
  if (to_control && !desk_->takes_commands())
    return send(plain_response(404, "nobody takes commands here\n"), false);
  if (!to_control && !desk_->has_room(peer()))
    return send(later_response(503, "too many live pages; try again later\n"), false);
  if (buffer_.size() != 0)
    return send(plain_response(400, "expected nothing before the upgrade's answer\n"), false);
  tcp().expires_never();
  websocket::stream_base::timeout timeout{};
  timeout.handshake_timeout = 10s;  // and for a close
  timeout.idle_timeout = 30s;
  timeout.keep_alive_pings = true;
  stream_.set_option(timeout);
  stream_.read_message_max(to_control ? kLongestCommand : kLongestClientMessage);
  stream_.async_accept(
      request, on(to_control ? &BeastSession::on_control_upgraded : &BeastSession::on_upgraded));
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

void BeastSession::close(std::string_view why, log::Level level) {
  if (!close_once()) return;
  // A browser opens and leaves connections all the time.
  if (level >= log::Level::kWarning)
    log::write(level, "web", net::text_of(peer()) + " tcp " + std::string(why));
  if (live_) desk_->feed().leave(*std::exchange(live_, nullptr));
  desk_->end_control(*this);
  tcp().close();
}

}  // namespace

std::vector<std::string> own_names(const WebConfig& config) {
  std::vector<std::string> names = config.hosts;
  names.push_back(net::host_name());
  return names;
}

std::unique_ptr<native::ControlConversation> WebDesk::begin_control(WebSession& session) {
  if (operators_ == nullptr) return nullptr;
  std::vector<net::Peer> holders;
  for (const WebSession* one : controls_) holders.push_back(one->peer());
  const net::Place place = net::place_for(session.peer(), holders, kMostControls);
  if (!place.is_there) return nullptr;
  if (place.instead_of) {
    const auto other = std::find_if(
        controls_.rbegin(), controls_.rend(),
        [&](const WebSession* one) { return one->peer().same_address(*place.instead_of); });
    (*other)->close("gives its place to another operator", log::Level::kInfo);
  }
  controls_.push_back(&session);
  return std::make_unique<native::ControlConversation>(native::random_challenge(), *operators_,
                                                       wrong_, hash(session.peer()));
}

std::shared_ptr<WebSession> make_session(net::Socket socket, const net::Peer& peer,
                                         std::shared_ptr<WebDesk> desk) {
  return std::make_shared<BeastSession>(std::move(socket), peer, std::move(desk));
}

}  // namespace fiducap::web
