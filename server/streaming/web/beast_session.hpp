#pragma once

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/websocket.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "streaming/web/live_feed.hpp"
#include "streaming/web/view_feed.hpp"
#include "streaming/web/web_session.hpp"

// Private to web_session.cpp and web_sockets.cpp.
namespace fiducap::web {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using ErrorCodeOf = boost::system::error_code;

inline constexpr std::uint32_t kHeaderLimit = 8192;
inline constexpr std::size_t kReadLimit = 2 * kHeaderLimit;

[[nodiscard]] inline std::string_view view_of(beast::string_view text) {
  return {text.data(), text.size()};
}

/// A session on Beast: requests in web_session.cpp, WebSockets in web_sockets.cpp.
class BeastSession final : public WebSession {
 public:
  BeastSession(net::Socket socket, const net::Peer& peer, std::shared_ptr<WebContext> context);
  ~BeastSession() override { leave_places(); }

  void start() override { context_->may_ask(peer()) ? read_request() : pause(); }
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
      if (!log::guarded("web", whose, [&] { (self.get()->*handler)(error, rest...); })) self->end();
    };
  }

  void read_request();
  void pause();
  void end_of(ErrorCodeOf) { end(); }
  void end() { close("left", log::Level::kDebug); }

  void on_request(ErrorCodeOf error, std::size_t bytes);
  void refuse(ErrorCodeOf error);
  void send(HttpResponse response, bool keep_alive);
  void on_sent(ErrorCodeOf error, std::size_t bytes);
  void linger();
  void on_lingered(ErrorCodeOf error, std::size_t bytes);
  void leave_places();
  [[nodiscard]] bool is_forwarded() const;
  [[nodiscard]] bool is_own_page() const;
  enum class SocketKind { kLive, kControl, kViews };
  [[nodiscard]] static std::optional<SocketKind> socket_at(std::string_view path);
  [[nodiscard]] std::optional<HttpResponse> refusal_of(SocketKind kind);
  void upgrade(SocketKind kind);
  void on_upgraded(ErrorCodeOf error);
  void join_live();
  void on_live_proof(ErrorCodeOf error, std::size_t bytes);
  void on_live_reply(ErrorCodeOf error, std::size_t bytes);
  void on_live_read(ErrorCodeOf error, std::size_t bytes);
  template <class Client>
  void write_next(Client& client, std::string_view places);
  void on_written(ErrorCodeOf error, std::size_t bytes);
  [[nodiscard]] std::span<const std::byte> received() const;
  void tune_socket(bool text);
  void close_socket(const websocket::close_reason& reason);
  void on_control_upgraded(ErrorCodeOf error);
  void on_command(ErrorCodeOf error, std::size_t bytes);
  void send_replies();
  void on_replied(ErrorCodeOf error, std::size_t bytes);
  void on_views_upgraded(ErrorCodeOf error);
  void on_view_request(ErrorCodeOf error, std::size_t bytes);
  void prove_view();
  void on_view_reply(ErrorCodeOf error, std::size_t bytes);

  websocket::stream<beast::tcp_stream> stream_;
  std::shared_ptr<WebContext> context_;
  beast::flat_buffer buffer_{kReadLimit};
  std::optional<http::request_parser<http::empty_body>> parser_;
  std::optional<Response> response_;
  std::shared_ptr<const std::string> body_;
  std::shared_ptr<LiveConnection> live_;
  std::shared_ptr<ViewConnection> view_;
  Message writing_;
  std::unique_ptr<native::ControlConversation> control_;
  std::unique_ptr<native::ControlConversation> reader_;  ///< Of a live page that needs a proof.
  std::uint64_t tokens_at_{0};                           ///< tokens_changed() at the upgrade.
  std::vector<std::byte> replies_;
  bool hangs_up_{false};
  std::size_t lingered_{0};
  std::optional<Instant> paused_until_;
};

}  // namespace fiducap::web
