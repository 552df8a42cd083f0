#include <utility>

#include "src/discovery.hpp"
#include "src/prediction.hpp"
#include "src/receiver.hpp"

namespace fiducap {

namespace {

bool find_valid(const Frame& frame, const std::string& name, Body& body) {
  for (const Body& candidate : frame.bodies) {
    if (candidate.name != name) continue;
    if (!candidate.valid) return false;
    body = candidate;
    return true;
  }
  return false;
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
  if (!sdk::may_predict(ahead)) return false;
  bool found = false;
  impl_->latest().read([&](const Frame& newest) { found = find_valid(newest, name, body); });
  if (found) sdk::carry(body, ahead);
  return found;
}

bool Client::predict_now(const std::string& name, std::chrono::nanoseconds ahead,
                         Body& body) const {
  bool found = false;
  const auto target = std::chrono::nanoseconds(sdk::monotonic_now()) + ahead;
  impl_->latest().read([&](const Frame& newest) {
    if (newest.at_client_ns == 0) return;
    ahead = target - std::chrono::nanoseconds(newest.at_client_ns);
    found = sdk::may_predict(ahead) && find_valid(newest, name, body);
  });
  if (found) sdk::carry(body, ahead);
  return found;
}

bool Client::wait_for_frame(std::uint64_t after_number, std::chrono::milliseconds timeout) const {
  return impl_->wait_for_frame(after_number, timeout);
}

void Client::on_frame(std::function<void(const Frame&)> callback) {
  impl_->on_frame(std::move(callback));
}

void Client::on_connection(std::function<void(bool)> callback) {
  impl_->on_connection(std::move(callback));
}

ClientStatistics Client::statistics() const { return impl_->statistics(); }

std::vector<Client::Found> Client::discover(std::chrono::milliseconds timeout, std::uint16_t port) {
  return sdk::discover(timeout, port);
}

}  // namespace fiducap
