#include <fiducap.h>

int main(void) {
  fiducap_options options = fiducap_options_init();
  options.port = 1; /* nobody listens there */
  fiducap_client* client = fiducap_connect(&options, NULL, 0);
  fiducap_frame frame = fiducap_frame_init();
  const int any = client != NULL ? fiducap_latest(client, &frame, NULL, 0) : 1;
  fiducap_disconnect(client);
  return any;
}
