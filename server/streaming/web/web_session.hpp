#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "streaming/native/control_session.hpp"
#include "streaming/net/limits.hpp"
#include "streaming/net/tcp_session.hpp"
#include "streaming/web/content.hpp"
#include "streaming/web/http_routes.hpp"
#include "streaming/web/live_feed.hpp"
#include "streaming/web/view_feed.hpp"

namespace fiducap::web {

class WebSession;

/// This machine's name and those of the configuration.
[[nodiscard]] std::vector<std::string> own_names(const WebConfig& config);

/// Shared by the sessions of the server; without sockets.
class WebContext final {
 public:
  WebContext(const ProtocolContext& context, const WebConfig& config)
      : page_(PageFiles::load(page_root(config.root))),
        operators_(context.operator_api),
        setup_(context.setup),
        view_feed_(config.camera_views, context.views),
        feed_(config, context),
        most_pages_(static_cast<std::size_t>(config.max_clients)),
        names_(own_names(config)),
        clock_(context.clock) {}

  /// @param views  the client's access to cameras
  [[nodiscard]] HttpResponse answer(const HttpRequest& request, const ViewAccess& views) {
    return web::answer(
        request, page_,
        {[this] { return feed_.state(now()); }, [this] { return feed_.health(now()); },
         [this](MetricsFormat format) { return feed_.metrics(format, now()); },
         [&] { return plain_content(encode_view_list(views, view_feed_.cameras())); },
         [this] { return feed_.versions(now()); },
         [this](std::int64_t before, std::int64_t after) { return feed_.diff(before, after); }});
  }
  [[nodiscard]] bool knows(std::string_view host) const { return is_our_name(host, names_); }
  /// @return the address has a request left; `take_request` uses `cost` of them
  [[nodiscard]] bool may_ask(const net::Peer& peer) { return requests_.has(hash(peer), now()); }
  [[nodiscard]] bool take_request(const net::Peer& peer, double cost) {
    return requests_.allow(hash(peer), now(), cost);
  }
  /// @return there is a place for one more live page
  [[nodiscard]] bool has_place(const net::Peer& peer) const { return place_for(peer).is_there; }
  /// Takes a place, also from the address with the most pages. @return nullptr: none
  [[nodiscard]] std::shared_ptr<LiveConnection> join(const net::Peer& peer) {
    const net::Place place = place_for(peer);
    if (!place.is_there) return nullptr;
    if (place.instead_of) feed_.dismiss_newest_of(*place.instead_of);
    return feed_.join(peer, now());
  }
  /// @param is_forwarded  see ViewFeed
  [[nodiscard]] ViewAccess view_access(const net::Peer& peer, bool is_forwarded) const {
    const bool has_token = operators_ != nullptr && !operators_->token().empty();
    ViewAccess access = view_feed_.access(peer, is_forwarded, has_token);
    if (access.kind == ViewAccess::Kind::kGranted && reading_needs_proof())
      access = {ViewAccess::Kind::kProof, "camera views need a token of this server", true};
    return access;
  }
  /// A token for reading is configured.
  [[nodiscard]] bool reading_needs_proof() const {
    return operators_ != nullptr && !operators_->read_token().empty();
  }
  [[nodiscard]] std::uint64_t tokens_changed() const {
    return operators_ == nullptr ? 0 : operators_->tokens_changed();
  }
  /// @param authorization  of an HTTP request   @return nullopt: it may read
  [[nodiscard]] std::optional<HttpResponse> refusal_to_read(std::string_view authorization,
                                                            const net::Peer& peer);
  /// @param reads_only  a proof of the token for reading is enough, and there are no commands
  [[nodiscard]] std::unique_ptr<native::ControlConversation> begin_proof(const net::Peer& peer,
                                                                         bool reads_only);
  /// @return `secret` is that of the running set-up
  [[nodiscard]] bool leads_setup(std::string_view secret) const {
    return setup_ != nullptr && setup_->admits(secret);
  }
  /// Requires the secret of the set-up, which opens devices and writes files.
  [[nodiscard]] HttpResponse answer_setup(const HttpRequest& request, const net::Peer& peer,
                                          bool is_forwarded) {
    return web::answer_setup(request, setup_, peer.is_loopback() && !is_forwarded);
  }
  /// @return nullptr: denied, or no place
  [[nodiscard]] std::shared_ptr<ViewConnection> join_views(const net::Peer& peer,
                                                           bool is_forwarded);
  /// A command channel with a place, also from the address with the most.
  /// @return nullptr: no commands, or no place
  [[nodiscard]] std::unique_ptr<native::ControlConversation> begin_control(WebSession& session);
  void end_control(const WebSession& session) { std::erase(controls_, &session); }
  [[nodiscard]] bool takes_commands() const { return operators_ != nullptr; }
  [[nodiscard]] bool has_page() const { return !page_.empty(); }
  [[nodiscard]] LiveFeed& feed() { return feed_; }
  [[nodiscard]] ViewFeed& view_feed() { return view_feed_; }
  [[nodiscard]] Instant now() const { return clock_.now(); }

 private:
  [[nodiscard]] net::Place place_for(const net::Peer& peer) const {
    std::vector<net::Peer> holders;
    for (const auto& page : feed_.connections()) holders.push_back(page->peer());
    return net::place_for(peer, holders, most_pages_);
  }
  [[nodiscard]] std::uint64_t hash(const net::Peer& peer) const {
    return net::address_hash(hash_key_, peer);
  }

  static constexpr std::size_t kMostControls = 16;

  PageFiles page_;
  OperatorApi* operators_;
  SetupApi* setup_;
  ViewFeed view_feed_;
  LiveFeed feed_;
  std::size_t most_pages_;
  std::vector<std::string> names_;
  const Clock& clock_;
  std::array<std::uint64_t, 2> hash_key_{net::random_key()};
  net::RequestLimiter requests_;
  net::WrongProofs wrong_;
  std::vector<WebSession*> controls_;  ///< With a command channel, oldest first.
};

/// One TCP connection: HTTP requests until it ends or becomes a WebSocket with frames, commands or
/// pictures. Beast is only in beast_session.hpp and its sources.
class WebSession : public net::Session {
 public:
  using Session::Session;
  /// Writes the next message of a WebSocket; closes it when the client has stopped reading.
  virtual void pump() = 0;
};

[[nodiscard]] std::shared_ptr<WebSession> make_session(net::Socket socket, const net::Peer& peer,
                                                       std::shared_ptr<WebContext> context);

}  // namespace fiducap::web
