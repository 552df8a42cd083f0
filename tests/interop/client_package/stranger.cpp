#include <fiducap/client.hpp>
#include <fiducap/control.hpp>

int main() {
  fiducap::ClientOptions options;
  options.port = 1;  // without a server
  const fiducap::Client client(options);
  fiducap::Frame frame;
  fiducap::Control control({});
  return client.latest(frame) ? 1 : 0;
}
