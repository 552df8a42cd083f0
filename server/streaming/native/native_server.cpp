#include "streaming/native/native_server.hpp"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>
#include <random>

#include "base/assert.hpp"
#include "base/log.hpp"
#include "streaming/native/datagram_sender.hpp"
#include "streaming/native/frame_encoder.hpp"
#include "streaming/native/registry.hpp"

namespace fiducap::native {

namespace {

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

// Requests handled before other work of the I/O thread gets its turn.
constexpr int kRequestsPerTurn = 64;
// A big scene for many clients at once must fit: 16 MB asked for, the kernel grants what net.core.wmem_max allows.
constexpr int kSendBuffer = 16 << 20;

Peer to_peer(const udp::endpoint& from) {
  Peer peer;
  peer.port = from.port();
  const auto address = from.address();
  const auto as_v6 = address.is_v6() ? address.to_v6()
                                     : asio::ip::make_address_v6(asio::ip::v4_mapped, address.to_v4());
  const auto bytes = as_v6.to_bytes();
  std::copy(bytes.begin(), bytes.end(), peer.address.begin());
  peer.scope = address.is_v6() ? static_cast<std::uint32_t>(as_v6.scope_id()) : 0;
  return peer;
}

udp::endpoint to_endpoint(const Peer& peer, bool ipv4_socket) {
  asio::ip::address_v6::bytes_type bytes;
  std::copy(peer.address.begin(), peer.address.end(), bytes.begin());
  const asio::ip::address_v6 as_v6(bytes, peer.scope);
  if (ipv4_socket) return {asio::ip::make_address_v4(asio::ip::v4_mapped, as_v6), peer.port};
  return {as_v6, peer.port};
}

std::string text_of(const Peer& peer) {
  const asio::ip::address_v6 address({peer.address}, peer.scope);
  const std::string host = address.is_v4_mapped()
                               ? asio::ip::make_address_v4(asio::ip::v4_mapped, address).to_string()
                               : "[" + address.to_string() + "]";
  return host + ":" + std::to_string(peer.port) + " udp";
}

std::uint64_t random_word(std::random_device& device) {
  return std::uint64_t{device()} << 32 | device();
}

/// Random for each start: nobody can guess tokens, and every client notices a restart.
Registry make_registry(const NativeConfig& config) {
  std::random_device device;
  const std::array<std::uint64_t, 2> key{random_word(device), random_word(device)};
  return {RegistryLimits{config.max_clients, config.max_clients_per_address, from_seconds(config.lease_s)}, key,
          std::max<std::uint64_t>(1, random_word(device))};
}

/// Shared with the one pending wait of the socket, which may outlive the streamer in the I/O queue.
class NativeServer final : public std::enable_shared_from_this<NativeServer> {
 public:
  NativeServer(udp::socket socket, const NativeConfig& config, std::shared_ptr<const SceneModel> model,
               const Clock& clock)
      : clock_(clock),
        socket_(std::move(socket)),
        ipv4_(socket_.local_endpoint().address().is_v4()),
        registry_(make_registry(config)),
        encoder_(registry_.session()) {
    use(std::move(model));
  }

  void listen() {
    socket_.async_wait(udp::socket::wait_read, [weak = weak_from_this()](const error_code& error) {
      const auto self = weak.lock();
      if (!self || error || !self->socket_.is_open()) return;
      self->answer_requests();
      self->listen();
    });
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    if (!socket_.is_open()) return;
    if (const auto gone = registry_.expire(clock_.now()); gone > 0) {
      log::info("native", std::to_string(gone) + " client(s) fell silent and were forgotten");
    }
    if (frame->model->bodies.size() > kMaxBodies || frame->bodies.size() > kMaxBodies) return;
    if (frame->model->generation != model_->generation) {
      use(frame->model);
      for (auto& subscriber : registry_.subscribers()) send_model(subscriber.peer);
    }
    if (registry_.subscribers().empty()) return;
    sender_.load(encoder_.encode(*frame));
    for (auto& subscriber : registry_.subscribers()) {
      const auto to = to_endpoint(subscriber.peer, ipv4_);
      const bool sent = sender_.send_to(socket_.native_handle(), to.data(), static_cast<socklen_t>(to.size()));
      ++(sent ? subscriber.frames_sent : subscriber.frames_dropped);
    }
  }

  void append_clients(std::vector<ClientStatus>& out) const {
    const Instant now = clock_.now();
    for (const auto& subscriber : registry_.subscribers()) {
      std::string detail = subscriber.name.empty() ? "unnamed" : subscriber.name;
      if (subscriber.lost_on_the_way > 0) {
        detail += ", reports " + std::to_string(subscriber.lost_on_the_way) + " frames lost on the way";
      }
      out.push_back({"native", text_of(subscriber.peer), std::move(detail), subscriber.frames_sent,
                     subscriber.frames_dropped, to_seconds(now - subscriber.since)});
    }
  }

  void stop() {
    if (!socket_.is_open()) return;
    const auto notice = encode_notice(registry_.session(), 0, NoticeReason::kShuttingDown, "the server ends");
    for (const auto& subscriber : registry_.subscribers()) send(notice, subscriber.peer);
    error_code ignored;
    socket_.close(ignored);
  }

  [[nodiscard]] std::uint16_t port() const { return socket_.local_endpoint().port(); }

 private:
  void use(std::shared_ptr<const SceneModel> model) {
    model_ = std::move(model);
    model_datagrams_ = encode_model(registry_.session(), *model_);
  }

  void answer_requests() {
    udp::endpoint from;
    for (int i = 0; i < kRequestsPerTurn; ++i) {
      error_code error;
      const auto size = socket_.receive_from(asio::buffer(request_), from, 0, error);
      if (error == asio::error::would_block) return;
      if (error) continue;  // the answer to an earlier datagram came back as unreachable: not this one's fault
      answer(std::span(request_).first(size), to_peer(from));
    }
  }

  void answer(std::span<const std::byte> request, const Peer& from) {
    const auto reply = registry_.receive(request, from, model_->generation, clock_.now());
    if (!reply.datagram.empty()) send(reply.datagram, from);
    if (reply.send_model) send_model(from);
    if (reply.event == Registry::Event::kJoined) log::info("native", text_of(from) + " subscribed");
    if (reply.event == Registry::Event::kLeft) log::info("native", text_of(from) + " left");
  }

  void send_model(const Peer& to) {
    for (const auto& part : model_datagrams_) send(part, to);
  }

  /// A control datagram that the socket does not take is lost like any other; the client asks again.
  void send(const Datagram& datagram, const Peer& to) {
    error_code ignored;
    socket_.send_to(asio::buffer(datagram), to_endpoint(to, ipv4_), 0, ignored);
  }

  const Clock& clock_;
  udp::socket socket_;
  bool ipv4_;
  Registry registry_;
  FrameEncoder encoder_;
  DatagramSender sender_;
  std::shared_ptr<const SceneModel> model_;
  std::vector<Datagram> model_datagrams_;
  std::array<std::byte, kMaxDatagram + 1> request_{};  // one more: a longer datagram is seen as too long
};

/// What the hub owns.
class NativeStreamer final : public Streamer {
 public:
  explicit NativeStreamer(std::shared_ptr<NativeServer> server) : server_(std::move(server)) {}
  ~NativeStreamer() override { server_->stop(); }
  NativeStreamer(const NativeStreamer&) = delete;
  NativeStreamer& operator=(const NativeStreamer&) = delete;

  [[nodiscard]] std::string_view protocol() const override { return "native"; }
  void publish(const std::shared_ptr<const SceneFrame>& frame) override { server_->publish(frame); }
  void append_clients(std::vector<ClientStatus>& out) const override { server_->append_clients(out); }
  void stop() override { server_->stop(); }
  [[nodiscard]] std::uint16_t port() const { return server_->port(); }

 private:
  std::shared_ptr<NativeServer> server_;
};

Expected<udp::socket> bind_socket(asio::io_context& io, const NativeConfig& config) {
  const std::string where = config.address + ":" + std::to_string(config.port) + " udp";
  error_code error;
  const auto address = asio::ip::make_address(config.address, error);
  if (error) return fail(ErrorCode::kInvalid, "expected an IP address, e.g. 127.0.0.1 or 0.0.0.0", where);
  const udp::endpoint endpoint(address, config.port);
  udp::socket socket(io);
  socket.open(endpoint.protocol(), error);
  if (!error) socket.bind(endpoint, error);
  if (error == asio::error::address_in_use) {
    return fail(ErrorCode::kUnavailable,
                "the port is in use, perhaps by another fiducapd: end that one (`ss -lunp` names it) or set "
                "streaming.native.port to a free one",
                where);
  }
  if (error) {
    return fail(ErrorCode::kUnavailable,
                "cannot listen (" + error.message() + "): set streaming.native.address to one of this machine's",
                where);
  }
  error_code ignored;  // a smaller buffer only means counted drops earlier
  socket.set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
  socket.non_blocking(true, error);
  if (error) return fail(ErrorCode::kUnavailable, "cannot make the socket non-blocking: " + error.message(), where);
  return socket;
}

}  // namespace

std::vector<ConfigError> NativeConfig::check() const {
  error_code error;
  asio::ip::make_address(address, error);
  return Checker{"streaming.native."}
      .require(!error, "address", address, "must be an IP address, e.g. 127.0.0.1 or 0.0.0.0")
      .within("max_clients", max_clients, 1, 1024)
      .within("max_clients_per_address", max_clients_per_address, 1, 1024)
      .within("lease_s", lease_s, 0.5, 60)
      .errors;
}

Expected<std::unique_ptr<Streamer>> start_native_server(asio::io_context& io, const NativeConfig& config,
                                                        std::shared_ptr<const SceneModel> model, const Clock& clock) {
  if (model->bodies.size() > kMaxBodies) {
    return fail(ErrorCode::kInvalid, "the native protocol carries at most " + std::to_string(kMaxBodies) +
                                         " bodies, the scene has " + std::to_string(model->bodies.size()));
  }
  auto socket = bind_socket(io, config);
  if (!socket) return tl::unexpected(socket.error());
  auto server = std::make_shared<NativeServer>(std::move(*socket), config, std::move(model), clock);
  server->listen();
  return std::make_unique<NativeStreamer>(std::move(server));
}

std::uint16_t bound_port(const Streamer& native_server) {
  const auto* streamer = dynamic_cast<const NativeStreamer*>(&native_server);
  FIDUCAP_ASSERT(streamer != nullptr);
  return streamer->port();
}

}  // namespace fiducap::native
