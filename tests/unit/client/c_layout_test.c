/* The C structs as programs made for ABI 1 know them (64-bit): a field that moves breaks every one
 * of them. New fields go to the end; then only the sizes below change. Compiled as C; there is
 * nothing to run. */
#include <fiducap.h>

#define AT(type, field, offset) \
  _Static_assert(offsetof(type, field) == (offset), #type "." #field " moved")
#define SIZE(type, size) _Static_assert(sizeof(type) == (size), #type " has another size")

#if UINTPTR_MAX == UINT64_MAX
AT(fiducap_options, port, 4);
AT(fiducap_options, up, 6);
AT(fiducap_options, turn_bodies, 7);
AT(fiducap_options, server, 8);
AT(fiducap_options, name, 16);
AT(fiducap_options, reconnect_s, 24);
AT(fiducap_options, max_rate_hz, 32);
AT(fiducap_options, bodies, 40);
AT(fiducap_options, body_count, 48);
AT(fiducap_options, without_covariance, 52);
AT(fiducap_options, multicast, 53);
SIZE(fiducap_options, 56);
#endif

AT(fiducap_body, id, 4);
AT(fiducap_body, tracking, 8);
AT(fiducap_body, valid, 12);
AT(fiducap_body, tags_in_view, 16);
AT(fiducap_body, position_m, 24);
AT(fiducap_body, orientation_wxyz, 48);
AT(fiducap_body, velocity_m_s, 80);
AT(fiducap_body, body_rate_rad_s, 104);
AT(fiducap_body, acceleration_m_s2, 128);
AT(fiducap_body, position_sigma_m, 152);
AT(fiducap_body, rotation_sigma_rad, 160);
AT(fiducap_body, velocity_sigma_m_s, 168);
AT(fiducap_body, rate_sigma_rad_s, 176);
AT(fiducap_body, age_s, 184);
AT(fiducap_body, pose_covariance, 192);
AT(fiducap_body, name, 276);
SIZE(fiducap_body, 408);

AT(fiducap_frame, body_size, 4);
AT(fiducap_frame, body_count, 8);
AT(fiducap_frame, number, 16);
AT(fiducap_frame, at_server_ns, 24);
AT(fiducap_frame, at_client_ns, 32);
AT(fiducap_frame, at_utc_ns, 40);
AT(fiducap_frame, published_server_ns, 48);
AT(fiducap_frame, received_ns, 56);
AT(fiducap_frame, map_version, 64);
AT(fiducap_frame, rate_hz, 72);
AT(fiducap_frame, clock_sigma_s, 80);
SIZE(fiducap_frame, 88);

AT(fiducap_statistics, connected, 4);
AT(fiducap_statistics, frames, 8);
AT(fiducap_statistics, lost, 16);
AT(fiducap_statistics, dropped_by_server, 24);
AT(fiducap_statistics, dropped_here, 32);
AT(fiducap_statistics, reconnects, 40);
AT(fiducap_statistics, rate_hz, 48);
AT(fiducap_statistics, latency_p50_s, 56);
AT(fiducap_statistics, latency_p99_s, 64);
AT(fiducap_statistics, latency_max_s, 72);
AT(fiducap_statistics, clock_offset_ns, 80);
AT(fiducap_statistics, clock_drift_ppm, 88);
AT(fiducap_statistics, clock_sigma_s, 96);
AT(fiducap_statistics, clock_bound_s, 104);
AT(fiducap_statistics, round_trip_s, 112);
AT(fiducap_statistics, clock_known, 120);
AT(fiducap_statistics, multicast, 124);
AT(fiducap_statistics, problem, 128);
SIZE(fiducap_statistics, 384);

AT(fiducap_found, port, 4);
AT(fiducap_found, bodies, 6);
AT(fiducap_found, rate_hz, 8);
AT(fiducap_found, address, 16);
AT(fiducap_found, host, 80);
AT(fiducap_found, version, 148);
SIZE(fiducap_found, 184);

AT(fiducap_controlled_body, id, 4);
AT(fiducap_controlled_body, enabled, 8);
AT(fiducap_controlled_body, pivot_position_m, 16);
AT(fiducap_controlled_body, pivot_orientation_wxyz, 40);
AT(fiducap_controlled_body, name, 72);
SIZE(fiducap_controlled_body, 208);

AT(fiducap_recording, state, 4);
AT(fiducap_recording, samples, 8);
AT(fiducap_recording, bytes, 16);
AT(fiducap_recording, dropped, 24);
AT(fiducap_recording, name, 32);
AT(fiducap_recording, reason, 164);
SIZE(fiducap_recording, 424);

AT(fiducap_event, severity, 4);
AT(fiducap_event, over, 8);
AT(fiducap_event, number, 16);
AT(fiducap_event, at_utc_ms, 24);
AT(fiducap_event, subject, 32);
AT(fiducap_event, kind, 164);
AT(fiducap_event, text, 200);
AT(fiducap_event, remedy, 716);
SIZE(fiducap_event, 1232);

int fiducap_layout_is_checked(void);
int fiducap_layout_is_checked(void) { return 1; }
