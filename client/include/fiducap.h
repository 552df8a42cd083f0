/* The Fiducap client for C and other languages. Same conventions as fiducap/client.hpp: axes W (z
 * up) and P, metres, radians, seconds, quaternions Hamilton w x y z.
 *
 * Every struct begins with its own size, set by the caller (as <struct>_init() does): a library
 * with more fields than the caller omits them, one with fewer leaves the caller's unchanged. Fields
 * are only appended. Functions return 1 for success, 0 otherwise (see each), block only with a
 * timeout, and never throw. */
#ifndef FIDUCAP_H
#define FIDUCAP_H

#include "fiducap/types.h"

#if defined(__GNUC__)
#define FIDUCAP_API __attribute__((visibility("default")))
#else
#define FIDUCAP_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define FIDUCAP_ABI_VERSION 1

/* Increases when programs built for an older library no longer run with it. */
FIDUCAP_API uint32_t fiducap_abi_version(void);
/* `0.1.0` */
FIDUCAP_API const char* fiducap_version(void);

typedef struct fiducap_client fiducap_client;

/* Connects in the background and reconnects by itself. Returns at once. NULL when the options are
 * invalid or the system has no thread left; `problem` (may be NULL) then has the cause. */
FIDUCAP_API fiducap_client* fiducap_connect(const fiducap_options* options, char* problem,
                                            size_t problem_size);
FIDUCAP_API void fiducap_disconnect(fiducap_client* client);

/* The newest frame, at most `capacity` of its bodies. Wait-free, no allocation. 0: no frame yet;
 * nothing is written. */
FIDUCAP_API int fiducap_latest(const fiducap_client* client, fiducap_frame* frame,
                               fiducap_body* bodies, uint32_t capacity);
/* One body, predicted to `ahead_ns` after the instant of the newest frame; 0: unknown, not valid or
 * too far ahead. Wait-free. */
FIDUCAP_API int fiducap_predict(const fiducap_client* client, const char* name, int64_t ahead_ns,
                                fiducap_body* body);
/* The same to `ahead_ns` after now; 0 also while the clock offset is unknown or the frame is too
 * old. */
FIDUCAP_API int fiducap_predict_now(const fiducap_client* client, const char* name,
                                    int64_t ahead_ns, fiducap_body* body);
/* Waits for a frame newer than `after_number`. 0: timeout. */
FIDUCAP_API int fiducap_wait_for_frame(const fiducap_client* client, uint64_t after_number,
                                       uint32_t timeout_ms);
FIDUCAP_API void fiducap_get_statistics(const fiducap_client* client,
                                        fiducap_statistics* statistics);

/* Servers on this machine and its networks; takes the whole timeout. Every found[i].struct_size
 * must be set. Returns the number written, at most `capacity`. port 0: 21600. */
FIDUCAP_API uint32_t fiducap_discover(uint32_t timeout_ms, uint16_t port, fiducap_found* found,
                                      uint32_t capacity);

#ifdef __cplusplus
}
#endif

#include "fiducap/control.h"
#include "fiducap/events.h"

#endif /* FIDUCAP_H */
