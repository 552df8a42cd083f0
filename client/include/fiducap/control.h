/* Part of fiducap.h, which includes this file: changes of the server's state, with the operator's
 * token. Calls wait for the reply, at most timeout_ms; 0: not executed, `problem` (may be NULL) has
 * the cause. One handle is used by one thread at a time. */
#ifndef FIDUCAP_CONTROL_H
#define FIDUCAP_CONTROL_H

#include "fiducap.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct fiducap_control fiducap_control;

typedef struct {
  uint32_t struct_size;
  int32_t id;
  int32_t enabled;
  uint32_t reserved;
  double pivot_position_m[3];
  double pivot_orientation_wxyz[4];
  char name[FIDUCAP_NAME_SIZE];
} fiducap_controlled_body;
FIDUCAP_INIT_OF(fiducap_controlled_body)

enum {
  FIDUCAP_RECORDING_STARTING = 0, /* samples are accepted; the files are not open yet */
  FIDUCAP_RECORDING_RUNNING = 1,
  FIDUCAP_RECORDING_STOPPING = 2, /* accepted samples are being written */
  FIDUCAP_RECORDING_FINISHED = 3, /* everything is on disk */
  FIDUCAP_RECORDING_FAILED = 4    /* ended; see reason */
};

typedef struct {
  uint32_t struct_size;
  int32_t state;
  uint64_t samples; /* on disk: IMU samples, and images or their corners */
  uint64_t bytes;   /* on disk */
  uint64_t dropped; /* not recorded, because the disk was slow or failed */
  char name[FIDUCAP_NAME_SIZE];
  char reason[FIDUCAP_TEXT_SIZE]; /* cause of the failure, else empty */
  uint32_t reserved;
} fiducap_recording;
FIDUCAP_INIT_OF(fiducap_recording)

/* NULL when there is no memory. server NULL: 127.0.0.1, port 0: 21600, timeout_ms 0: 2000. */
FIDUCAP_API fiducap_control* fiducap_control_open(const char* server, uint16_t port,
                                                  const char* token, uint32_t timeout_ms);
FIDUCAP_API void fiducap_control_close(fiducap_control* control);
/* @param bodies      every bodies[i].struct_size must be set; @param count in: capacity, out:
 * number of bodies
 * @param mapping     1: the map is refined; may be NULL
 * @param recording   name of the running recording, FIDUCAP_NAME_SIZE bytes; may be NULL */
FIDUCAP_API int fiducap_control_list(fiducap_control* control, fiducap_controlled_body* bodies,
                                     uint32_t* count, int* mapping, char* recording, char* problem,
                                     size_t problem_size);
FIDUCAP_API int fiducap_control_set_enabled(fiducap_control* control, int32_t body_id, int enabled,
                                            char* problem, size_t problem_size);
FIDUCAP_API int fiducap_control_rename(fiducap_control* control, int32_t body_id, const char* name,
                                       char* problem, size_t problem_size);
FIDUCAP_API int fiducap_control_set_pivot(fiducap_control* control, int32_t body_id,
                                          const double position_m[3],
                                          const double orientation_wxyz[4], char* problem,
                                          size_t problem_size);
FIDUCAP_API int fiducap_control_set_mapping(fiducap_control* control, int mapping, char* problem,
                                            size_t problem_size);
FIDUCAP_API int fiducap_control_commit_map(fiducap_control* control, char* problem,
                                           size_t problem_size);
/* All running ones and up to eight ended ones; the newest last. Arrays as in
 * fiducap_control_list. */
FIDUCAP_API int fiducap_control_recordings(fiducap_control* control, fiducap_recording* recordings,
                                           uint32_t* count, char* problem, size_t problem_size);
/* Start and stop return before the disk has finished; fiducap_control_recordings has the state.
 * name NULL or empty: the date and time */
FIDUCAP_API int fiducap_control_start_recording(fiducap_control* control, const char* name,
                                                char* problem, size_t problem_size);
FIDUCAP_API int fiducap_control_stop_recording(fiducap_control* control, char* problem,
                                               size_t problem_size);

#ifdef __cplusplus
}
#endif

#endif /* FIDUCAP_CONTROL_H */
