#include <chrono>
#include <exception>
#include <new>

#include "fiducap.h"
#include "src/c_struct.hpp"
#include "src/discovery.hpp"
#include "src/prediction.hpp"
#include "src/receiver.hpp"

struct fiducap_client {
  explicit fiducap_client(const fiducap::ClientOptions& options) : receiver(options) {}
  fiducap::sdk::Receiver receiver;
};

namespace fiducap::sdk {

namespace {

ClientOptions to_options(const fiducap_options* given) {
  const fiducap_options in = take(given);
  ClientOptions options;
  if (in.server != nullptr) options.server = in.server;
  if (in.port != 0) options.port = in.port;
  if (in.name != nullptr) options.name = in.name;
  if (in.reconnect_s > 0) options.reconnect_s = in.reconnect_s;
  options.up = in.up == FIDUCAP_UP_Y ? WorldUp::kY : WorldUp::kZ;
  options.scope = in.turn_bodies != 0 ? TurnedAxes::kWorldAndBody : TurnedAxes::kWorld;
  options.max_rate_hz = in.max_rate_hz;
  for (std::uint32_t i = 0; in.bodies != nullptr && i < in.body_count; ++i) {
    options.bodies.push_back(text_or(in.bodies[i], ""));
  }
  options.covariance = in.without_covariance == 0;
  options.multicast = in.multicast != 0;
  return options;
}

fiducap_body to_c(const Body& body) {
  fiducap_body out{};
  out.id = body.id;
  out.tracking = static_cast<std::int32_t>(body.tracking);
  out.valid = body.valid ? 1 : 0;
  out.tags_in_view = body.tags_in_view;
  std::copy(body.position_m.begin(), body.position_m.end(), out.position_m);
  std::copy(body.orientation_wxyz.begin(), body.orientation_wxyz.end(), out.orientation_wxyz);
  std::copy(body.velocity_m_s.begin(), body.velocity_m_s.end(), out.velocity_m_s);
  std::copy(body.body_rate_rad_s.begin(), body.body_rate_rad_s.end(), out.body_rate_rad_s);
  std::copy(body.acceleration_m_s2.begin(), body.acceleration_m_s2.end(), out.acceleration_m_s2);
  out.position_sigma_m = body.position_sigma_m;
  out.rotation_sigma_rad = body.rotation_sigma_rad;
  out.velocity_sigma_m_s = body.velocity_sigma_m_s;
  out.rate_sigma_rad_s = body.rate_sigma_rad_s;
  out.age_s = body.age_s;
  std::copy(body.pose_covariance.begin(), body.pose_covariance.end(), out.pose_covariance);
  give_text(body.name, out.name, sizeof(out.name));
  return out;
}

fiducap_frame to_c(const Frame& frame, std::uint32_t body_size) {
  fiducap_frame out{};
  out.body_size = body_size;
  out.body_count = static_cast<std::uint32_t>(frame.bodies.size());
  out.number = frame.number;
  out.at_server_ns = frame.at_server_ns;
  out.at_client_ns = frame.at_client_ns;
  out.at_utc_ns = frame.at_utc_ns;
  out.published_server_ns = frame.published_server_ns;
  out.received_ns = frame.received_ns;
  out.map_version = frame.map_version;
  out.rate_hz = frame.rate_hz;
  out.clock_sigma_s = frame.clock_sigma_s;
  return out;
}

void give_bodies(const Frame& frame, std::uint32_t body_size, fiducap_body* bodies,
                 std::uint32_t capacity) {
  auto* at = reinterpret_cast<unsigned char*>(bodies);
  const std::size_t count = std::min<std::size_t>(capacity, frame.bodies.size());
  for (std::size_t i = 0; i < count; ++i, at += body_size) {
    fiducap_body body = to_c(frame.bodies[i]);
    body.struct_size = body_size;
    std::memcpy(at, &body, std::min<std::size_t>(body_size, sizeof(body)));
  }
}

int predict(const LatestFrame& latest, const char* name, std::int64_t ahead_ns, bool from_now,
            fiducap_body* out) {
  if (name == nullptr || out == nullptr) return 0;
  thread_local Body carried;  // keeps the memory of its name: only the first call allocates
  bool found = false;
  std::chrono::nanoseconds ahead(ahead_ns);
  const Nanoseconds now = monotonic_now();
  latest.read([&](const Frame& frame) {
    if (from_now && frame.at_client_ns == 0) return;
    if (from_now) ahead += std::chrono::nanoseconds(now - frame.at_client_ns);
    if (!may_predict(ahead)) return;
    for (const Body& body : frame.bodies) {
      if (!body.valid || body.name != name) continue;
      carried = body;
      found = true;
      return;
    }
  });
  if (!found) return 0;
  carry(carried, ahead);
  return give(to_c(carried), out) ? 1 : 0;
}

fiducap_statistics to_c(const ClientStatistics& in) {
  fiducap_statistics out{};
  out.connected = in.connected ? 1 : 0;
  out.frames = in.frames;
  out.lost = in.lost;
  out.dropped_by_server = in.dropped_by_server;
  out.dropped_here = in.dropped_here;
  out.reconnects = in.reconnects;
  out.rate_hz = in.rate_hz;
  out.latency_p50_s = in.latency_p50_s;
  out.latency_p99_s = in.latency_p99_s;
  out.latency_max_s = in.latency_max_s;
  out.clock_offset_ns = in.clock.offset_ns;
  out.clock_drift_ppm = in.clock.drift_ppm;
  out.clock_sigma_s = in.clock.sigma_s;
  out.clock_bound_s = in.clock.bound_s;
  out.round_trip_s = in.clock.round_trip_s;
  out.clock_known = in.clock.known ? 1 : 0;
  out.multicast = in.multicast ? 1 : 0;
  give_text(in.problem, out.problem, sizeof(out.problem));
  return out;
}

}  // namespace

}  // namespace fiducap::sdk

namespace sdk = fiducap::sdk;

std::uint32_t fiducap_abi_version(void) { return FIDUCAP_ABI_VERSION; }

const char* fiducap_version(void) { return FIDUCAP_CLIENT_VERSION; }

fiducap_client* fiducap_connect(const fiducap_options* options, char* problem,
                                size_t problem_size) {
  try {
    return new fiducap_client(sdk::to_options(options));
  } catch (const std::exception& why) {
    sdk::give_text(why.what(), problem, problem_size);
    return nullptr;
  }
}

void fiducap_disconnect(fiducap_client* client) { delete client; }

int fiducap_latest(const fiducap_client* client, fiducap_frame* frame, fiducap_body* bodies,
                   uint32_t capacity) {
  if (client == nullptr || frame == nullptr) return 0;
  const std::uint32_t stride = sdk::take(frame).body_size;
  const bool has_room = bodies != nullptr && stride >= sizeof(std::uint32_t);
  const bool any = client->receiver.latest().read([&](const fiducap::Frame& newest) {
    sdk::give(sdk::to_c(newest, stride), frame);
    if (has_room) sdk::give_bodies(newest, stride, bodies, capacity);
  });
  return any ? 1 : 0;
}

int fiducap_predict(const fiducap_client* client, const char* name, int64_t ahead_ns,
                    fiducap_body* body) {
  return client != nullptr ? sdk::predict(client->receiver.latest(), name, ahead_ns, false, body)
                           : 0;
}

int fiducap_predict_now(const fiducap_client* client, const char* name, int64_t ahead_ns,
                        fiducap_body* body) {
  return client != nullptr ? sdk::predict(client->receiver.latest(), name, ahead_ns, true, body)
                           : 0;
}

int fiducap_wait_for_frame(const fiducap_client* client, uint64_t after_number,
                           uint32_t timeout_ms) {
  if (client == nullptr) return 0;
  return client->receiver.wait_for_frame(after_number, std::chrono::milliseconds(timeout_ms)) ? 1
                                                                                              : 0;
}

void fiducap_get_statistics(const fiducap_client* client, fiducap_statistics* statistics) {
  if (client != nullptr) sdk::give(sdk::to_c(client->receiver.statistics()), statistics);
}

uint32_t fiducap_discover(uint32_t timeout_ms, uint16_t port, fiducap_found* found,
                          uint32_t capacity) {
  try {
    const auto all = sdk::discover(std::chrono::milliseconds(timeout_ms), port != 0 ? port : 21600);
    std::uint32_t count = 0;
    for (const auto& one : all) {
      if (found == nullptr || count == capacity) break;
      fiducap_found out{};
      out.port = one.port;
      out.bodies = static_cast<std::uint16_t>(one.bodies);
      out.rate_hz = one.rate_hz;
      sdk::give_text(one.address, out.address, sizeof(out.address));
      sdk::give_text(one.host, out.host, sizeof(out.host));
      sdk::give_text(one.version, out.version, sizeof(out.version));
      // The caller's stride is the size it gave.
      auto* at = reinterpret_cast<unsigned char*>(found) + std::size_t{count} * found->struct_size;
      if (!sdk::give(out, reinterpret_cast<fiducap_found*>(at))) break;
      ++count;
    }
    return count;
  } catch (const std::exception&) {  // no memory
    return 0;
  }
}
