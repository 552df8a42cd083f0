#include <fiducap/client.hpp>
#include <fiducap/control.hpp>

int main() {
  fiducap::ClientOptions options;
  options.port = 1;  // nobody listens there
  const fiducap::Client client(options);
  fiducap::Frame frame;
  fiducap::Control control({});
  return client.latest(frame) ? 1 : 0;
}
