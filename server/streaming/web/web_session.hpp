#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/web/http_routes.hpp"
#include "streaming/web/live_feed.hpp"
#include "streaming/web/page_files.hpp"

namespace fiducap::web {

/// This machine's name and those of the configuration.
[[nodiscard]] std::vector<std::string> own_names(const WebConfig& config);

/// Everything a session asks its server, without a socket. Shared by the sessions, so that it
/// outlives the last of them.
class WebDesk final {
 public:
  WebDesk(const WebConfig& config, WebSources sources, std::shared_ptr<const SceneModel> model,
          const Clock& clock)
      : page_(PageFiles::load(page_root(config.root))),
        feed_(config, std::move(sources), std::move(model)),
        most_pages_(static_cast<std::size_t>(config.max_clients)),
        names_(own_names(config)),
        clock_(clock) {}

  [[nodiscard]] HttpResponse answer(const HttpRequest& request) const {
    return web::answer(request, page_,
                       {[this] { return feed_.state(); }, [this] { return feed_.trouble(now()); }});
  }
  [[nodiscard]] bool knows(std::string_view host) const { return is_our_name(host, names_); }
  [[nodiscard]] bool has_room() const { return feed_.connections().size() < most_pages_; }
  [[nodiscard]] bool has_page() const { return !page_.empty(); }
  [[nodiscard]] LiveFeed& feed() { return feed_; }
  [[nodiscard]] const LiveFeed& feed() const { return feed_; }
  [[nodiscard]] Instant now() const { return clock_.now(); }

 private:
  PageFiles page_;
  LiveFeed feed_;
  std::size_t most_pages_;
  std::vector<std::string> names_;
  const Clock& clock_;
};

/// One TCP connection: HTTP requests until it ends or becomes a live socket. Beast stays in the
/// one source file.
class WebSession : public net::Session {
 public:
  using Session::Session;
  /// Writes what waits for a live page; closes it when it has stopped reading. Nothing for a plain
  /// HTTP connection.
  virtual void pump() = 0;
};

[[nodiscard]] std::shared_ptr<WebSession> make_session(net::Socket socket, const net::Peer& peer,
                                                       std::shared_ptr<WebDesk> desk);

}  // namespace fiducap::web
