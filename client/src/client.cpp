#include <cmath>
#include <utility>

#include "src/receiver.hpp"

namespace fiducap {

namespace {

using Quaternion = std::array<double, 4>;  // w x y z

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
          a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
          a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Unit quaternion of the rotation vector rate × dt.
Quaternion exponential(const std::array<double, 3>& rate, double dt) {
  const double speed = std::sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]);
  const double half = 0.5 * speed * dt;
  // sin(half) / speed, with its limit where the quotient has none.
  const double scale = std::abs(half) < 1e-9 ? 0.5 * dt : std::sin(half) / speed;
  return {std::cos(half), rate[0] * scale, rate[1] * scale, rate[2] * scale};
}

Quaternion normalized(const Quaternion& q) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm};
}

/// Constant velocity in W, constant body rate in P (hence the product from the right).
void carry(Body& body, double dt) {
  for (std::size_t i = 0; i < 3; ++i) body.position_m[i] += body.velocity_m_s[i] * dt;
  body.orientation_wxyz = normalized(product(body.orientation_wxyz, exponential(body.body_rate_rad_s, dt)));
  body.age_s += dt;
}

}  // namespace

class Client::Impl : public sdk::Receiver {
 public:
  using sdk::Receiver::Receiver;
};

Client::Client(ClientOptions options) : impl_(std::make_unique<Impl>(options)) {}

Client::~Client() = default;

bool Client::latest(Frame& frame) const {
  return impl_->latest().read([&](const Frame& newest) { frame = newest; });
}

bool Client::predict(const std::string& name, std::chrono::nanoseconds ahead, Body& body) const {
  bool found = false;
  impl_->latest().read([&](const Frame& newest) {
    for (const Body& candidate : newest.bodies) {
      if (candidate.name != name || !candidate.valid) continue;
      body = candidate;
      found = true;
      return;
    }
  });
  if (found) carry(body, static_cast<double>(ahead.count()) * 1e-9);
  return found;
}

bool Client::wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const {
  return impl_->wait_for_frame(after_number, timeout);
}

void Client::on_frame(std::function<void(const Frame&)> callback) { impl_->on_frame(std::move(callback)); }

void Client::on_connection(std::function<void(bool)> callback) { impl_->on_connection(std::move(callback)); }

ClientStatistics Client::statistics() const { return impl_->statistics(); }

}  // namespace fiducap
