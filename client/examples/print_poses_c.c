/* Prints every valid body ten times a second, in C: print_poses_c [host] [port] [seconds] */
#include <fiducap.h>

#include <stdio.h>
#include <stdlib.h>

int main(int argc, char** argv) {
  fiducap_options options = fiducap_options_init();
  char problem[FIDUCAP_TEXT_SIZE] = "";
  options.name = "print_poses_c";
  options.max_rate_hz = 10;
  if (argc > 1) options.server = argv[1];
  if (argc > 2) options.port = (uint16_t)atoi(argv[2]);
  const int frames = argc > 3 ? 10 * atoi(argv[3]) : 100;

  fiducap_client* client = fiducap_connect(&options, problem, sizeof(problem));
  if (client == NULL) {
    fprintf(stderr, "%s\n", problem);
    return 1;
  }
  fiducap_frame frame = fiducap_frame_init();
  static fiducap_body bodies[64];
  for (int i = 0; i < frames; ++i) {
    if (!fiducap_wait_for_frame(client, frame.number, 1000) ||
        !fiducap_latest(client, &frame, bodies, 64)) {
      fiducap_statistics statistics = fiducap_statistics_init();
      fiducap_get_statistics(client, &statistics);
      printf("no frame: %s\n", statistics.problem);
      continue;
    }
    for (uint32_t b = 0; b < frame.body_count && b < 64; ++b) {
      if (!bodies[b].valid) continue; /* never fly with a pose that is not valid */
      printf("%s at %.3f %.3f %.3f\n", bodies[b].name, bodies[b].position_m[0],
             bodies[b].position_m[1], bodies[b].position_m[2]);
    }
    fflush(stdout);
  }
  fiducap_disconnect(client);
  return 0;
}
