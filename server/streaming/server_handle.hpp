#pragma once

#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "streaming/streamer.hpp"

namespace fiducap {

/// What the hub owns of a protocol: stops the server at its end. The server itself lives until its
/// last handler on the I/O thread has run.
/// @tparam Door    Streamer, or a protocol's interface below it; its own functions ask server()
/// @tparam Server  has publish, append_clients and stop as Streamer has them; stop may come twice
template <typename Door, typename Server>
class ServerHandle : public Door {
 public:
  /// @param protocol  lives for ever
  ServerHandle(std::string_view protocol, std::shared_ptr<Server> server)
      : protocol_(protocol), server_(std::move(server)) {}
  ~ServerHandle() override { server_->stop(); }
  ServerHandle(const ServerHandle&) = delete;
  ServerHandle& operator=(const ServerHandle&) = delete;

  [[nodiscard]] std::string_view protocol() const final { return protocol_; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) final { server_->publish(frame); }
  void append_clients(std::vector<ClientStatus>& out) const final { server_->append_clients(out); }
  void stop() final { server_->stop(); }

 protected:
  [[nodiscard]] const Server& server() const { return *server_; }

 private:
  std::string_view protocol_;
  std::shared_ptr<Server> server_;
};

}  // namespace fiducap
