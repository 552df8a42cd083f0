#include "streaming/native/native_server.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>
#include <optional>
#include <random>

#include "base/assert.hpp"
#include "base/log.hpp"
#include "streaming/native/broadcast_ears.hpp"
#include "streaming/native/client_text.hpp"
#include "streaming/native/control_server.hpp"
#include "streaming/native/endpoint.hpp"
#include "streaming/native/profile_stream.hpp"
#include "streaming/native/registry.hpp"
#include "streaming/net/bind.hpp"
#include "streaming/net/datagram_batch.hpp"
#include "streaming/server_handle.hpp"

namespace fiducap::native {

namespace {

namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

// Requests handled before other work of the I/O thread gets its turn.
constexpr int kRequestsPerTurn = 64;
// A big scene for many clients at once must fit: 16 MB asked for, the kernel grants what
// net.core.wmem_max allows.
constexpr int kSendBuffer = 16 << 20;
constexpr int kBindAttempts = 16;  // for port 0

std::uint64_t random_word(std::random_device& device) {
  return std::uint64_t{device()} << 32 | device();
}

/// Random for each start: nobody can guess tokens, and every client notices a restart.
Registry make_registry(const NativeConfig& config) {
  std::random_device device;
  const std::array<std::uint64_t, 2> key{random_word(device), random_word(device)};
  return {RegistryLimits{config.max_clients, config.max_clients_per_address,
                         from_seconds(config.lease_s)},
          key, std::max<std::uint64_t>(1, random_word(device))};
}

/// Shared with the one pending wait of the socket, which may outlive the streamer in the I/O queue.
class NativeServer final : public std::enable_shared_from_this<NativeServer> {
 public:
  NativeServer(udp::socket socket, const NativeConfig& config,
               const std::shared_ptr<const SceneModel>& model, const Clock& clock)
      : config_(config),
        clock_(clock),
        socket_(std::move(socket)),
        ipv4_(socket_.local_endpoint().address().is_v4()),
        registry_(make_registry(config)) {
    streams_.push_back(
        std::make_unique<ProfileStream>(registry_.session(), GrantedProfile{}, *model));
    use(model);
  }

  void listen() {
    socket_.async_wait(udp::socket::wait_read, [weak = weak_from_this()](const error_code& error) {
      const auto self = weak.lock();
      if (!self || error || !self->socket_.is_open()) return;
      self->answer_requests();
      self->listen();
    });
  }

  void be_discovered(asio::io_context& io) {
    introduce(0);
    ears_.emplace(
        io, config_.address, port(),
        [weak = weak_from_this()](std::span<const std::byte> query, const udp::endpoint& from) {
          if (const auto self = weak.lock()) self->answer(query, to_peer(from));
        });
  }

  [[nodiscard]] Expected<void> join_group() {
    const auto group = asio::ip::make_address_v4(config_.multicast_group);
    const std::string& by =
        config_.multicast_interface.empty() ? config_.address : config_.multicast_interface;
    error_code error;
    const auto interface = asio::ip::make_address_v4(by, error);
    if (error)
      return fail(ErrorCode::kInvalid,
                  "multicast needs an IPv4 address: set streaming.native.address", by);
    if (!interface.is_unspecified()) {
      socket_.set_option(asio::ip::multicast::outbound_interface(interface), error);
      if (error) {
        return fail(ErrorCode::kUnavailable,
                    "no interface has this address (" + error.message() +
                        "): set streaming.native.multicast_interface to one of this machine's",
                    by);
      }
    }
    socket_.set_option(asio::ip::multicast::hops(config_.multicast_ttl), error);
    if (!error) socket_.set_option(asio::ip::multicast::enable_loopback(true), error);
    if (error)
      return fail(ErrorCode::kUnavailable, "cannot send multicast: " + error.message(), by);
    group_ = udp::endpoint(group, config_.multicast_port);
    registry_.offer_multicast({group.to_bytes(), config_.multicast_port});
    return {};
  }

  [[nodiscard]] Expected<void> take_commands(asio::io_context& io, OperatorDesk& desk) {
    auto control =
        ControlServer::open(io, {config_.address, port(), "streaming.native"}, desk, clock_);
    if (!control) return tl::unexpected(control.error());
    control_ = std::move(*control);
    return {};
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) {
    if (!socket_.is_open()) return;
    if (const auto gone = registry_.expire(clock_.now()); gone > 0) {
      log::info("native", std::to_string(gone) + " client(s) fell silent and were forgotten");
    }
    if (control_) control_->tick(clock_.now());
    if (frame->model->bodies.size() > kMaxBodies || frame->bodies.size() > kMaxBodies) return;
    if (frame->model->generation != model_->generation) {
      use(frame->model);
      for (auto& subscriber : registry_.subscribers())
        send_model(subscriber.profile, subscriber.peer);
    }
    if (frame->rate_hz != card_rate_hz_) introduce(frame->rate_hz);
    if (!registry_.subscribers().empty()) send(*frame);
  }

  void append_clients(std::vector<ClientStatus>& out) const {
    const Instant now = clock_.now();
    for (const auto& subscriber : registry_.subscribers()) {
      out.push_back({"native", net::peer_text(to_endpoint(subscriber.peer, ipv4_)),
                     text_of(subscriber, profile_of(subscriber.profile)), subscriber.frames_sent,
                     subscriber.frames_dropped, to_seconds(now - subscriber.since),
                     clock_of(subscriber)});
    }
  }

  void stop() {
    if (control_) control_->stop();
    if (ears_) ears_->stop();
    if (!socket_.is_open()) return;
    const auto notice =
        encode_notice(registry_.session(), 0, NoticeReason::kShuttingDown, "the server ends");
    for (const auto& subscriber : registry_.subscribers()) send(notice, subscriber.peer);
    error_code ignored;
    socket_.close(ignored);
  }

  [[nodiscard]] std::uint16_t port() const { return socket_.local_endpoint().port(); }

 private:
  void use(std::shared_ptr<const SceneModel> model) {
    model_ = std::move(model);
    for (const auto& stream : streams_) stream->use(*model_);
    introduce(card_rate_hz_);
  }

  void introduce(double rate_hz) {
    card_rate_hz_ = rate_hz;
    if (!config_.discovery) return;
    registry_.introduce_as(ServerCard{asio::ip::host_name(), FIDUCAP_VERSION,
                                      static_cast<std::uint32_t>(model_->bodies.size()), rate_hz,
                                      port()});
  }

  /// One stream per profile in use, the default one first.
  void follow_profiles() {
    const auto granted = registry_.profiles();
    const auto is_gone = [&](const std::unique_ptr<ProfileStream>& stream) {
      return stream->number() != 0 &&
             std::none_of(granted.begin(), granted.end(),
                          [&](const GrantedProfile& g) { return g.number == stream->number(); });
    };
    std::erase_if(streams_, is_gone);
    for (const auto& one : granted) {
      const bool is_here = std::any_of(streams_.begin(), streams_.end(), [&](const auto& stream) {
        return stream->number() == one.number;
      });
      if (!is_here)
        streams_.push_back(std::make_unique<ProfileStream>(registry_.session(), one, *model_));
    }
  }

  [[nodiscard]] const Profile& profile_of(std::uint32_t number) const {
    for (const auto& granted : registry_.profiles()) {
      if (granted.number == number) return granted.profile;
    }
    return streams_.front()->profile();  // the default one
  }

  /// Every profile's frame to its clients, all in one batch.
  void send(const SceneFrame& frame) {
    follow_profiles();
    const auto subscribers = registry_.subscribers();
    addresses_.resize(subscribers.size());
    sends_.clear();
    batch_.clear();
    for (const auto& stream : streams_) {
      bool anybody = false;
      for (const auto& subscriber : subscribers)
        anybody = anybody || subscriber.profile == stream->number();
      if (!anybody) continue;
      const auto datagrams = stream->encode(frame);
      if (!datagrams.empty()) add_to_batch(stream->number(), datagrams);
    }
    batch_.send(socket_.native_handle());
    for (const auto& one : sends_) {
      bool sent = true;
      for (std::size_t i = one.first; i < one.first + one.count; ++i) sent = sent && batch_.sent(i);
      auto& subscriber = registry_.subscribers()[one.subscriber];
      ++(sent ? subscriber.frames_sent : subscriber.frames_dropped);
    }
  }

  void add_to_batch(std::uint32_t profile, std::span<const std::span<const std::byte>> datagrams) {
    const auto subscribers = registry_.subscribers();
    std::optional<std::size_t> to_group;  // its first datagram in the batch
    for (std::size_t i = 0; i < subscribers.size(); ++i) {
      if (subscribers[i].profile != profile) continue;
      std::size_t first = batch_.size();
      if (subscribers[i].multicast) {
        if (!to_group) {
          to_group = first;
          for (const auto& datagram : datagrams) add(datagram, group_);
        }
        first = *to_group;
      } else {
        addresses_[i] = to_endpoint(subscribers[i].peer, ipv4_);
        for (const auto& datagram : datagrams) add(datagram, addresses_[i]);
      }
      sends_.push_back({i, first, datagrams.size()});
    }
  }

  void add(std::span<const std::byte> datagram, const udp::endpoint& to) {
    batch_.add(datagram, to.data(), static_cast<socklen_t>(to.size()));
  }

  void answer_requests() {
    udp::endpoint from;
    for (int i = 0; i < kRequestsPerTurn; ++i) {
      error_code error;
      const auto size = socket_.receive_from(asio::buffer(request_), from, 0, error);
      if (error == asio::error::would_block) return;
      if (error)
        continue;  // the answer to an earlier datagram came back as unreachable: not this one's
                   // fault
      answer(std::span(request_).first(size), to_peer(from));
    }
  }

  void answer(std::span<const std::byte> request, const Peer& from) {
    const auto reply = registry_.receive(request, from, model_->generation, clock_.now());
    if (!reply.datagram.empty()) send(reply.datagram, from);
    if (reply.send_model) {
      follow_profiles();
      send_model(reply.profile, from);
    }
    if (reply.event == Registry::Event::kNone) return;
    const std::string who = net::peer_text(to_endpoint(from, ipv4_));
    log::info("native", who + (reply.event == Registry::Event::kJoined ? " subscribed" : " left"));
  }

  void send_model(std::uint32_t profile, const Peer& to) {
    for (const auto& stream : streams_) {
      if (stream->number() != profile) continue;
      for (const auto& part : stream->model()) send(part, to);
    }
  }

  /// A control datagram that the socket does not take is lost like any other; the client asks
  /// again.
  void send(const Datagram& datagram, const Peer& to) {
    error_code ignored;
    socket_.send_to(asio::buffer(datagram), to_endpoint(to, ipv4_), 0, ignored);
  }

  struct Send {
    std::size_t subscriber;
    std::size_t first;  ///< In the batch.
    std::size_t count;
  };

  NativeConfig config_;
  const Clock& clock_;
  udp::socket socket_;
  bool ipv4_;
  Registry registry_;
  std::vector<std::unique_ptr<ProfileStream>> streams_;
  net::DatagramBatch batch_;
  std::vector<udp::endpoint> addresses_;  ///< Of the subscribers, while a batch points at them.
  std::vector<Send> sends_;
  udp::endpoint group_;
  std::shared_ptr<const SceneModel> model_;
  double card_rate_hz_{0};
  std::optional<BroadcastEars> ears_;
  std::unique_ptr<ControlServer> control_;
  std::array<std::byte, kMaxDatagram + 1>
      request_{};  // one more: a longer datagram is seen as too long
};

class NativeStreamer final : public ServerHandle<Streamer, NativeServer> {
 public:
  using ServerHandle::ServerHandle;
  [[nodiscard]] std::uint16_t port() const { return server().port(); }
};

}  // namespace

namespace {

/// One attempt: the number that UDP got on port 0 may be taken for TCP.
Expected<std::shared_ptr<NativeServer>> open_server(asio::io_context& io,
                                                    const NativeConfig& config,
                                                    const std::shared_ptr<const SceneModel>& model,
                                                    const Clock& clock, OperatorDesk* desk) {
  auto socket = net::bind_udp(io, {config.address, config.port, "streaming.native"});
  if (!socket) return tl::unexpected(socket.error());
  error_code ignored;  // a smaller buffer only means counted drops earlier
  socket->set_option(asio::socket_base::send_buffer_size(kSendBuffer), ignored);
  auto server = std::make_shared<NativeServer>(std::move(*socket), config, model, clock);
  if (!config.multicast_group.empty()) {
    if (auto joined = server->join_group(); !joined) return tl::unexpected(joined.error());
  }
  if (config.control && desk != nullptr) {
    if (auto taken = server->take_commands(io, *desk); !taken) return tl::unexpected(taken.error());
  }
  return server;
}

}  // namespace

Expected<std::unique_ptr<Streamer>> start_native_server(asio::io_context& io,
                                                        const NativeConfig& config,
                                                        std::shared_ptr<const SceneModel> model,
                                                        const Clock& clock, OperatorDesk* desk) {
  if (model->bodies.size() > kMaxBodies) {
    return fail(ErrorCode::kInvalid, "the native protocol carries at most " +
                                         std::to_string(kMaxBodies) + " bodies, the scene has " +
                                         std::to_string(model->bodies.size()));
  }
  auto server = open_server(io, config, model, clock, desk);
  for (int i = 1; i < kBindAttempts && !server && config.port == 0; ++i)
    server = open_server(io, config, model, clock, desk);
  if (!server) return tl::unexpected(server.error());
  (*server)->listen();
  if (config.discovery) (*server)->be_discovered(io);
  log::info("native", "serves Fiducap clients on " + config.address + ":" +
                          std::to_string((*server)->port()) +
                          (config.control ? " (UDP; control by TCP)" : " (UDP)"));
  return std::make_unique<NativeStreamer>("native", std::move(*server));
}

std::uint16_t bound_port(const Streamer& native_server) {
  const auto* streamer = dynamic_cast<const NativeStreamer*>(&native_server);
  FIDUCAP_ASSERT(streamer != nullptr);
  return streamer->port();
}

}  // namespace fiducap::native
