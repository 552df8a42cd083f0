/* The C structs as programs made for ABI 1 know them (64-bit): a field that moves breaks every one
 * of them. New fields go to the end; then only the sizes below change. Compiled as C; there is
 * nothing to run. */
#include <fiducap.h>

#define AT(field, offset) (offsetof(STRUCT, field) == (offset))

#if UINTPTR_MAX == UINT64_MAX
#define STRUCT fiducap_options
_Static_assert(AT(port, 4) && AT(up, 6) && AT(turn_bodies, 7) && AT(server, 8) && AT(name, 16) &&
                   AT(reconnect_s, 24) && AT(max_rate_hz, 32) && AT(bodies, 40) &&
                   AT(body_count, 48) && AT(without_covariance, 52) && AT(multicast, 53) &&
                   sizeof(STRUCT) == 56,
               "fiducap_options has another layout");
#undef STRUCT
#endif

#define STRUCT fiducap_body
_Static_assert(AT(id, 4) && AT(tracking, 8) && AT(valid, 12) && AT(tags_in_view, 16) &&
                   AT(position_m, 24) && AT(orientation_wxyz, 48) && AT(velocity_m_s, 80) &&
                   AT(body_rate_rad_s, 104) && AT(acceleration_m_s2, 128) &&
                   AT(position_sigma_m, 152) && AT(rotation_sigma_rad, 160) &&
                   AT(velocity_sigma_m_s, 168) && AT(rate_sigma_rad_s, 176) && AT(age_s, 184) &&
                   AT(pose_covariance, 192) && AT(name, 276) && sizeof(STRUCT) == 408,
               "fiducap_body has another layout");
#undef STRUCT

#define STRUCT fiducap_frame
_Static_assert(AT(body_size, 4) && AT(body_count, 8) && AT(number, 16) && AT(at_server_ns, 24) &&
                   AT(at_client_ns, 32) && AT(at_utc_ns, 40) && AT(published_server_ns, 48) &&
                   AT(received_ns, 56) && AT(map_version, 64) && AT(rate_hz, 72) &&
                   AT(clock_sigma_s, 80) && sizeof(STRUCT) == 88,
               "fiducap_frame has another layout");
#undef STRUCT

#define STRUCT fiducap_statistics
_Static_assert(AT(connected, 4) && AT(frames, 8) && AT(lost, 16) && AT(dropped_by_server, 24) &&
                   AT(dropped_here, 32) && AT(reconnects, 40) && AT(rate_hz, 48) &&
                   AT(latency_p50_s, 56) && AT(latency_p99_s, 64) && AT(latency_max_s, 72) &&
                   AT(clock_offset_ns, 80) && AT(clock_drift_ppm, 88) && AT(clock_sigma_s, 96) &&
                   AT(clock_bound_s, 104) && AT(round_trip_s, 112) && AT(clock_known, 120) &&
                   AT(multicast, 124) && AT(problem, 128) && sizeof(STRUCT) == 384,
               "fiducap_statistics has another layout");
#undef STRUCT

#define STRUCT fiducap_found
_Static_assert(AT(port, 4) && AT(bodies, 6) && AT(rate_hz, 8) && AT(address, 16) && AT(host, 80) &&
                   AT(version, 148) && sizeof(STRUCT) == 184,
               "fiducap_found has another layout");
#undef STRUCT

#define STRUCT fiducap_controlled_body
_Static_assert(AT(id, 4) && AT(enabled, 8) && AT(pivot_position_m, 16) &&
                   AT(pivot_orientation_wxyz, 40) && AT(name, 72) && sizeof(STRUCT) == 208,
               "fiducap_controlled_body has another layout");
#undef STRUCT

#define STRUCT fiducap_recording
_Static_assert(AT(state, 4) && AT(samples, 8) && AT(bytes, 16) && AT(dropped, 24) && AT(name, 32) &&
                   AT(reason, 164) && sizeof(STRUCT) == 424,
               "fiducap_recording has another layout");
#undef STRUCT

#define STRUCT fiducap_event
_Static_assert(AT(severity, 4) && AT(over, 8) && AT(number, 16) && AT(at_utc_ms, 24) &&
                   AT(subject, 32) && AT(kind, 164) && AT(text, 200) && AT(remedy, 716) &&
                   sizeof(STRUCT) == 1232,
               "fiducap_event has another layout");
#undef STRUCT

int fiducap_layout_is_checked(void);
int fiducap_layout_is_checked(void) { return 1; }
