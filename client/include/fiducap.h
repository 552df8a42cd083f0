/* The Fiducap client for C and whatever speaks C. Same conventions as fiducap/client.hpp: axes W (z
 * up) and P, metres, radians, seconds, quaternions Hamilton w x y z.
 *
 * Every struct begins with its own size, set by the caller (as <struct>_init() does): a library
 * that knows more fields than the caller leaves them out, one that knows fewer leaves the caller's
 * as they are. Fields are only ever appended. Functions return 1 for yes, 0 for no (see each),
 * never block unless a timeout is named, and never throw. */
#ifndef FIDUCAP_H
#define FIDUCAP_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__GNUC__)
#define FIDUCAP_API __attribute__((visibility("default")))
#else
#define FIDUCAP_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define FIDUCAP_ABI_VERSION 1
#define FIDUCAP_NAME_SIZE 132 /* 128 bytes of UTF-8 and a closing zero */
#define FIDUCAP_TEXT_SIZE 256

/* Counts up when a program made for an older library would no longer run with it. */
FIDUCAP_API uint32_t fiducap_abi_version(void);
/* `0.1.0` */
FIDUCAP_API const char* fiducap_version(void);

/* Defines <struct>_init(): all zero, and its size. */
#define FIDUCAP_INIT_OF(type)                  \
  static inline type type##_init(void) {       \
    type made;                                 \
    memset(&made, 0, sizeof(made));            \
    made.struct_size = (uint32_t)sizeof(made); \
    return made;                               \
  }

enum { FIDUCAP_SEARCHING = 0, FIDUCAP_TRACKING = 1, FIDUCAP_COASTING = 2, FIDUCAP_LOST = 3 };
enum { FIDUCAP_UP_Z = 0, FIDUCAP_UP_Y = 1 };

typedef struct fiducap_client fiducap_client;

typedef struct {
  uint32_t struct_size;
  uint16_t port;             /* 0: 21600 */
  uint8_t up;                /* FIDUCAP_UP_… */
  uint8_t turn_bodies;       /* 1: with y up the bodies' own axes turn, too */
  const char* server;        /* address or host name; NULL: 127.0.0.1 */
  const char* name;          /* for the operator's list; NULL: none */
  double reconnect_s;        /* 0: 0.5 */
  double max_rate_hz;        /* 0: every frame */
  const char* const* bodies; /* names; NULL: all */
  uint32_t body_count;
  uint8_t without_covariance;
  uint8_t multicast;
  uint8_t reserved[2]; /* 0 */
} fiducap_options;
FIDUCAP_INIT_OF(fiducap_options)

typedef struct {
  uint32_t struct_size;
  int32_t id;
  int32_t tracking; /* FIDUCAP_SEARCHING … */
  int32_t valid;    /* 0: there is no pose, all numbers down to the covariance are NaN */
  int32_t tags_in_view;
  uint32_t reserved;
  double position_m[3];
  double orientation_wxyz[4];
  double velocity_m_s[3];
  double body_rate_rad_s[3];
  double acceleration_m_s2[3];
  double position_sigma_m;
  double rotation_sigma_rad;
  double velocity_sigma_m_s;
  double rate_sigma_rad_s;
  double age_s;              /* since the last image with a tag */
  float pose_covariance[21]; /* upper triangle, row by row, of (position, rotation vector) */
  char name[FIDUCAP_NAME_SIZE];
} fiducap_body;
FIDUCAP_INIT_OF(fiducap_body)

typedef struct {
  uint32_t struct_size;
  uint32_t body_size;  /* sizeof(fiducap_body) of the caller: the stride of its array */
  uint32_t body_count; /* bodies in the frame; those beyond the caller's capacity are left out */
  uint32_t reserved;
  uint64_t number;
  int64_t at_server_ns; /* the instant the poses are for, server's clock */
  int64_t at_client_ns; /* the same instant on this machine's CLOCK_MONOTONIC; 0: not known */
  int64_t at_utc_ns;
  int64_t published_server_ns;
  int64_t received_ns; /* CLOCK_MONOTONIC */
  int64_t map_version;
  double rate_hz;
  double clock_sigma_s;
} fiducap_frame;
static inline fiducap_frame fiducap_frame_init(void) {
  fiducap_frame made;
  memset(&made, 0, sizeof(made));
  made.struct_size = (uint32_t)sizeof(made);
  made.body_size = (uint32_t)sizeof(fiducap_body);
  return made;
}

typedef struct {
  uint32_t struct_size;
  int32_t connected;
  uint64_t frames;
  uint64_t lost;
  uint64_t dropped_by_server;
  uint64_t dropped_here;
  uint64_t reconnects;
  double rate_hz;
  double latency_p50_s; /* NaN: not known */
  double latency_p99_s;
  double latency_max_s;
  int64_t clock_offset_ns; /* server = ours + offset */
  double clock_drift_ppm;
  double clock_sigma_s;
  double clock_bound_s;
  double round_trip_s;
  int32_t clock_known;
  int32_t multicast;
  char problem[FIDUCAP_TEXT_SIZE]; /* while not connected: why */
} fiducap_statistics;
FIDUCAP_INIT_OF(fiducap_statistics)

/* Connects in the background, comes back by itself. Returns at once.
 * NULL when the options cannot be or the system has no thread left; `problem` (may be NULL) says
 * why then. */
FIDUCAP_API fiducap_client* fiducap_connect(const fiducap_options* options, char* problem,
                                            size_t problem_size);
FIDUCAP_API void fiducap_disconnect(fiducap_client* client);

/* The newest frame, at most `capacity` of its bodies. Wait-free, no allocation. 0: none came yet,
 * nothing is written. */
FIDUCAP_API int fiducap_latest(const fiducap_client* client, fiducap_frame* frame,
                               fiducap_body* bodies, uint32_t capacity);
/* One body, carried to `ahead_ns` after the instant of the newest frame; 0: unknown, not valid or
 * too far. Wait-free. */
FIDUCAP_API int fiducap_predict(const fiducap_client* client, const char* name, int64_t ahead_ns,
                                fiducap_body* body);
/* The same to `ahead_ns` after now; 0 also while the clocks are unknown or the frame is too old. */
FIDUCAP_API int fiducap_predict_now(const fiducap_client* client, const char* name,
                                    int64_t ahead_ns, fiducap_body* body);
/* Waits for a frame newer than `after_number`. 0: the time is over. */
FIDUCAP_API int fiducap_wait_for_frame(const fiducap_client* client, uint64_t after_number,
                                       uint32_t timeout_ms);
FIDUCAP_API void fiducap_get_statistics(const fiducap_client* client,
                                        fiducap_statistics* statistics);

typedef struct {
  uint32_t struct_size;
  uint16_t port;
  uint16_t bodies;
  double rate_hz;
  char address[64];
  char host[68];
  char version[36];
} fiducap_found;
FIDUCAP_INIT_OF(fiducap_found)

/* Servers on this machine and its networks; takes the whole timeout. Every found[i].struct_size
 * must be set. Returns how many were written, at most `capacity`. port 0: 21600. */
FIDUCAP_API uint32_t fiducap_discover(uint32_t timeout_ms, uint16_t port, fiducap_found* found,
                                      uint32_t capacity);

/* --- control: changes of the server's state, with the operator's token. Calls wait for the answer,
 * at most timeout_ms; 0: not done, `problem` (may be NULL) says why. One handle belongs to one
 * thread at a time. */
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

/* NULL when there is no memory. server NULL: 127.0.0.1, port 0: 21600, timeout_ms 0: 2000. */
FIDUCAP_API fiducap_control* fiducap_control_open(const char* server, uint16_t port,
                                                  const char* token, uint32_t timeout_ms);
FIDUCAP_API void fiducap_control_close(fiducap_control* control);
/* @param bodies      every bodies[i].struct_size must be set; @param count in: capacity, out: how
 * many there are
 * @param mapping     1: the map is refined; may be NULL
 * @param recording   name of the recording under way, FIDUCAP_NAME_SIZE bytes; may be NULL */
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
/* name NULL or empty: the date and time */
FIDUCAP_API int fiducap_control_start_recording(fiducap_control* control, const char* name,
                                                char* problem, size_t problem_size);
FIDUCAP_API int fiducap_control_stop_recording(fiducap_control* control, char* problem,
                                               size_t problem_size);

#ifdef __cplusplus
}
#endif

#endif /* FIDUCAP_H */
