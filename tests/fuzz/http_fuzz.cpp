// Bytes of a stranger to the page's port, through its session. The first byte chooses: requests in
// one piece or in two, frames of a live socket behind a valid upgrade, contents of two messages of
// an operator's socket, or frames of a socket with pictures.
#include <sys/socket.h>

#include <boost/asio/io_context.hpp>

#include "fuzz/memory_file.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/web/web_session.hpp"
#include "support/fake_clock.hpp"
#include "support/fake_operator_api.hpp"
#include "support/fake_views.hpp"
#include "support/scene_builder.hpp"
#include "unit/streaming/web/loopback_client.hpp"
#include "unit/streaming/web/temporary_page.hpp"

using namespace fiducap::web;

namespace {

struct Page {
  boost::asio::io_context io;
  FakeClock clock{instant_from_ns(1'000'000'000)};
  TemporaryPage files;
  FakeOperatorApi operators;
  FakeViews views;
  std::shared_ptr<SceneFrame> frame = make_scene_frame({"arm", "drone"});
  std::shared_ptr<WebContext> context = std::make_shared<WebContext>(context_of(), config());

  [[nodiscard]] WebConfig config() const {
    WebConfig config;
    config.root = files.root().string();
    return config;
  }
  [[nodiscard]] ProtocolContext context_of() {
    ProtocolContext made{io, frame->model, clock, &operators};
    made.views = &views;
    return made;
  }
};

/// The other end of a session's connection, without a network.
class Stranger final {
 public:
  explicit Stranger(Page& page) : page_(page) {
    page_.clock.advance(std::chrono::seconds(10));  // its limit of requests is not used up
    require(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends_) == 0);
    net::Socket socket(new net::TcpSocket{boost::asio::ip::tcp::socket(page.io)});
    socket->asio.assign(boost::asio::ip::tcp::v4(), ends_[1]);
    session_ = make_session(std::move(socket), {0x7f000001, 4000}, page.context);
    session_->start();
  }
  ~Stranger() {
    session_->close("left", log::Level::kDebug);
    session_.reset();
    ::close(ends_[0]);
    run();
    require(page_.context->feed().connections().empty());
    require(page_.context->view_feed().connections().empty());
    for (const auto& [camera, request] : page_.views.watched) require(!request.has_value());
  }
  Stranger(const Stranger&) = delete;
  Stranger& operator=(const Stranger&) = delete;

  void send(std::span<const std::byte> bytes) {
    (void)!::send(ends_[0], bytes.data(), bytes.size(), MSG_NOSIGNAL);
    run();
  }
  /// @return the reply, as far as the socket took it
  std::string_view receive() {
    const ssize_t size = ::recv(ends_[0], received_.data(), received_.size(), 0);
    return {received_.data(), size > 0 ? static_cast<std::size_t>(size) : 0};
  }
  void tick() { session_->tick(page_.clock.now()), run(); }

 private:
  void run() {
    page_.io.restart();
    page_.io.poll();
  }

  Page& page_;
  int ends_[2]{};
  std::shared_ptr<WebSession> session_;
  static inline std::array<char, 1 << 16> received_{};
};

}  // namespace

FUZZ(http_fuzz, input) {
  static Page page;
  const unsigned which = input.choose(5);
  Stranger stranger(page);
  const bool is_live = which == 2, is_operator = which == 3;
  const bool is_viewer = which == 4;
  if (is_live || is_operator || is_viewer) {
    const std::string path = is_live ? "live" : is_viewer ? "views" : "control";
    const std::string upgrade =
        "GET /api/v1/" + path + " HTTP/1.1\r\nHost: localhost\r\n" + kUpgrade + "\r\n";
    stranger.send(std::as_bytes(std::span(upgrade)));
    require(stranger.receive().starts_with("HTTP/1.1 101 "));
  }
  const std::size_t cut = which == 1 || is_operator ? input.bytes.size() / 2 : input.bytes.size();
  const auto send = [&](std::span<const std::byte> bytes) {
    if (!is_operator) return stranger.send(bytes);
    const std::string frame =
        web_socket({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    stranger.send(std::as_bytes(std::span(frame)));
  };
  send(input.bytes.first(cut));
  page.context->feed().publish(page.frame);
  for (std::size_t i = 0; i < page.views.all.size(); ++i) page.views.make(i, "a picture");
  page.context->view_feed().tick(page.clock.now());
  stranger.tick();
  send(input.bytes.subspan(cut));
  const auto answer = stranger.receive();
  if (!is_live && !is_operator && !is_viewer)
    require(answer.empty() || answer.starts_with("HTTP/1.1 "));
  require(page.operators.changes.empty() && !page.operators.under_way);  // no proof by chance
}
