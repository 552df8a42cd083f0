/* Part of fiducap.h, which includes this file: events of a server for users. Needs no token. One
 * handle is used by one thread at a time. */
#ifndef FIDUCAP_EVENTS_H
#define FIDUCAP_EVENTS_H

#include "fiducap.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FIDUCAP_EVENT_TEXT_SIZE 516

enum { FIDUCAP_EVENT_INFO = 0, FIDUCAP_EVENT_WARNING = 1, FIDUCAP_EVENT_ERROR = 2 };

typedef struct fiducap_events fiducap_events;

typedef struct {
  uint32_t struct_size;
  int32_t severity;
  int32_t over; /* 1: a condition of this subject and kind ended here */
  uint32_t reserved;
  uint64_t number;                 /* counts up from 1 for the life of the server */
  int64_t at_utc_ms;               /* wall clock of the server, milliseconds since 1970 */
  char subject[FIDUCAP_NAME_SIZE]; /* a body's name, or a part: map, recorder, clock, server, ... */
  char kind[36];                   /* one word for programs: lost, overload, ... */
  char text[FIDUCAP_EVENT_TEXT_SIZE];
  char remedy[FIDUCAP_EVENT_TEXT_SIZE]; /* what to do; empty: nothing */
} fiducap_event;
FIDUCAP_INIT_OF(fiducap_event)

/* Connects at the first call and again after a failure. NULL when there is no memory. server NULL:
 * 127.0.0.1, port 0: 21600. history 1: first the events that the server keeps. */
FIDUCAP_API fiducap_events* fiducap_events_open(const char* server, uint16_t port, int history);
FIDUCAP_API void fiducap_events_close(fiducap_events* events);
/* Waits for the next event. 0: timeout; `problem` (may be NULL) has the cause of a missing
 * connection, or is empty. */
FIDUCAP_API int fiducap_events_next(fiducap_events* events, uint32_t timeout_ms,
                                    fiducap_event* event, char* problem, size_t problem_size);
/* Conditions that hold according to the last message of the server. Every standing[i].struct_size
 * must be set. Returns their number; at most `capacity` are written. */
FIDUCAP_API uint32_t fiducap_events_standing(const fiducap_events* events, fiducap_event* standing,
                                             uint32_t capacity);

#ifdef __cplusplus
}
#endif

#endif /* FIDUCAP_EVENTS_H */
