// From conditions to alarms: one for each cause, with what follows from it left out.
import type { ServerEvent, Severity } from './protocol';

const RANK: Record<Severity, number> = { error: 0, warning: 1, info: 2 };

/** What is wrong, of one body or of several. */
export interface Alarm {
  subjects: string[];
  /** Its text and remedy are shown. */
  worst: ServerEvent;
  /** When the first of them began. */
  utcMs: number;
  /** Number of that one. */
  n: number;
}

// A busy computer reads, uses and refines late, whichever body it is.
const BUSY = /^(overload|map_late)$/;
const FOLLOWS_BUSY = /^(source_late|image_(rate|lost|duplicated)|silent.*|imu_silent)$/;
// Causes of one body in order: each explains those after it.
const CAUSES = [
  /^(failed|source_failed|camera.*)$/,
  /^overload$/,
  /^(source_late|silent.*|image_.*)$/,
  /^tracking$/,
];

/**
 * The most severe first, of equal ones the oldest: a new one moves none that is shown. Notes (severity info) are in the
 * list of events only.
 */
export function alarmsOf(standing: ServerEvent[]): Alarm[] {
  const events = standing.filter((event) => event.severity !== 'info' && !followsFromAnother(event, standing));
  const worst = (a: ServerEvent, b: ServerEvent): number => RANK[a.severity] - RANK[b.severity] || a.n - b.n;
  const isOfMap = (event: ServerEvent): number => Number(event.kind === 'map_late');
  const busy = events.filter((event) => BUSY.test(event.kind)).sort((a, b) => isOfMap(a) - isOfMap(b) || worst(a, b));
  const groups = [...events.filter((event) => !BUSY.test(event.kind)).map((event) => [event]), ...(busy.length > 0 ? [busy] : [])];
  return groups.map(alarmOf).sort((a, b) => RANK[a.worst.severity] - RANK[b.worst.severity] || a.n - b.n);
}

function followsFromAnother(event: ServerEvent, standing: ServerEvent[]): boolean {
  if (FOLLOWS_BUSY.test(event.kind) && standing.some((one) => BUSY.test(one.kind))) return true;
  const rank = CAUSES.findIndex((kinds) => kinds.test(event.kind));
  return standing.some((one) => one.subject === event.subject && CAUSES.slice(0, Math.max(0, rank)).some((kinds) => kinds.test(one.kind)));
}

/** @param events  of one cause; the first one is shown */
function alarmOf(events: ServerEvent[]): Alarm {
  const subjects = [...new Set(events.map((event) => event.subject))].sort();
  const [first] = [...events].sort((a, b) => a.n - b.n) as [ServerEvent];
  return { subjects, worst: events[0] as ServerEvent, utcMs: first.utcMs, n: first.n };
}
