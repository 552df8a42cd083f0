#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

#include "client_packets.hpp"
#include "stream_view.hpp"

namespace fiducap::vicon {

/// A client on a plain non-blocking socket that shares no code with the server. It asks like SDK 1.12 does: types after the
/// greeting, then frames. `pump` moves what can be moved.
class StrictClient final {
 public:
  StrictClient() = default;
  ~StrictClient();
  StrictClient(const StrictClient&) = delete;
  StrictClient& operator=(const StrictClient&) = delete;

  void connect(std::uint16_t port);
  void pump();

  /// Replaces the types it asked for.
  void want(const std::set<std::uint32_t>& types);
  void send(const client::Bytes& bytes);
  void stop_reading() { reading_ = false; }
  void resume_reading() { reading_ = true; }

  [[nodiscard]] bool closed_by_server() const { return closed_; }

  StreamView view;

 private:
  int socket_{-1};
  bool reading_{true};
  bool closed_{false};
  std::vector<std::byte> in_;
};

}  // namespace fiducap::vicon
