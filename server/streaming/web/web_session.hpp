#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <memory>

#include "streaming/web/web_desk.hpp"

namespace fiducap::web {

/// One TCP connection: HTTP requests until it ends or becomes a live socket. Keeps itself alive
/// while the peer does. Opaque, so that Beast stays in one file.
class WebSession;

[[nodiscard]] std::shared_ptr<WebSession> start_session(boost::asio::ip::tcp::socket socket,
                                                        std::shared_ptr<WebDesk> desk);
/// Writes what waits for a live page; closes it when it has stopped reading. Nothing for a plain
/// HTTP connection.
void pump(WebSession& session);
/// Ends the connection now.
void close(WebSession& session);

}  // namespace fiducap::web
