/* The structs of fiducap.h, which includes this file. Fields are only appended, so that programs
 * built for an older library keep working. */
#ifndef FIDUCAP_TYPES_H
#define FIDUCAP_TYPES_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define FIDUCAP_NAME_SIZE 132 /* 128 bytes of UTF-8 and a closing zero */
#define FIDUCAP_TEXT_SIZE 256

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

typedef struct {
  uint32_t struct_size;
  uint16_t port;             /* 0: 21600 */
  uint8_t up;                /* FIDUCAP_UP_… */
  uint8_t turn_bodies;       /* 1: with y up the bodies' axes are rotated, too */
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
  int32_t valid;    /* 0: no pose; all numbers down to the covariance are NaN */
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
  uint32_t body_count; /* bodies in the frame; those beyond the caller's capacity are omitted */
  uint32_t reserved;
  uint64_t number;
  int64_t at_server_ns; /* instant of the poses, server's clock */
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
  char problem[FIDUCAP_TEXT_SIZE]; /* cause of a missing connection */
} fiducap_statistics;
FIDUCAP_INIT_OF(fiducap_statistics)

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

#endif /* FIDUCAP_TYPES_H */
