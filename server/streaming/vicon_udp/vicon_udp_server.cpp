#include <algorithm>
#include <utility>

#include "base/log.hpp"
#include "middleware/net/peer.hpp"
#include "streaming/net/udp_server.hpp"
#include "streaming/vicon_udp/codec.hpp"
#include "streaming/vicon_udp/vicon_udp.hpp"

namespace fiducap::vicon_udp {

namespace {

constexpr std::string_view kKey = "streaming.vicon_udp";

constexpr net::UdpOptions kPort{
    .protocol = "vicon_udp", .broadcasts = true, .send_buffer_bytes = 4 << 20};

struct Receiver {
  net::Peer peer;
  net::DatagramShare datagrams{};
};

class ViconUdpServer final : public Streamer {
 public:
  ViconUdpServer(net::UdpServer port, const ViconUdpConfig& config, const Clock& clock)
      : Streamer("vicon_udp"),
        clock_(clock),
        since_(clock.now()),
        block_bytes_(static_cast<std::size_t>(config.block_bytes)),
        encoder_(block_bytes_, config.when_invalid, config.aliases),
        socket_(std::move(port)) {
    for (const auto& text : config.targets)
      if (const auto peer = receiver_in(text)) receivers_.push_back({*peer});
  }

  void publish(const std::shared_ptr<const SceneFrame>& frame) override {
    if (!socket_.is_open() || frame->model == nullptr) return;
    const auto bytes = encoder_.encode(*frame);
    if (bytes.empty()) return;
    net::DatagramBatch& batch = socket_.batch();
    batch.clear();
    for (Receiver& one : receivers_) {
      one.datagrams.open(batch);
      for (std::size_t at = 0; at < bytes.size(); at += block_bytes_)
        socket_.add(bytes.subspan(at, block_bytes_), one.peer);
      one.datagrams.close(batch);
    }
    socket_.send_batch();
    for (Receiver& one : receivers_) one.datagrams.settle(batch);
  }

  void append_clients(std::vector<ClientStatus>& out) const override {
    for (const Receiver& one : receivers_)
      out.push_back({"vicon_udp", text_of(one.peer) + " udp", "target, z-up mm",
                     one.datagrams.frames_sent(), one.datagrams.frames_dropped(),
                     to_seconds(clock_.now() - since_)});
  }
  void stop() override { socket_.stop(); }

 private:
  const Clock& clock_;
  Instant since_;
  std::size_t block_bytes_;
  BlockEncoder encoder_;
  net::UdpServer socket_;
  std::vector<Receiver> receivers_;
};

}  // namespace

StartedStreamer serve(const ProtocolContext& context, const ViconUdpConfig& config) {
  const bool is_local = std::ranges::all_of(config.targets, [](const std::string& target) {
    const auto peer = receiver_in(target);
    return peer && peer->is_loopback();
  });
  auto socket =
      net::UdpServer::open(context.io, {is_local ? "127.0.0.1" : "0.0.0.0", 0, kKey}, kPort);
  if (!socket) return tl::unexpected(socket.error());
  std::string where;
  for (const auto& target : config.targets) where += (where.empty() ? "" : ", ") + target;
  log::info("vicon_udp", "sends Vicon's UDP Object Stream to " + where);
  return std::make_unique<ViconUdpServer>(std::move(*socket), config, context.clock);
}

}  // namespace fiducap::vicon_udp
