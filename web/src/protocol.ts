// The server's messages (server/streaming/web/codec.hpp), checked before anything else sees them.
import { fields, list, number, numberOrNull, oneOf, text, tuple, type Fields } from './fields';

export type BodyState = 'searching' | 'tracking' | 'coasting' | 'lost';
export type TagState = 'local' | 'calibrated' | 'surveyed' | 'quarantined';
export type LogLevel = 'debug' | 'info' | 'warning' | 'error';
export type Vector3 = [number, number, number];
/** w x y z, unit. */
export type Quaternion = [number, number, number, number];
/** xx xy xz yy yz zz in m². */
export type Covariance = [number, number, number, number, number, number];

export interface BodyName {
  id: number;
  name: string;
}

export interface Hello {
  type: 'hello';
  server: string;
  version: string;
  mapMode: string;
  pageRateHz: number;
  /** For clients with the operator's token. */
  takesCommands: boolean;
  bodies: BodyName[];
}

/** Authorises requests while this socket is open. */
export interface Ticket {
  type: 'ticket';
  ticket: string;
}

export interface MapTag {
  id: number;
  edgeM: number;
  state: TagState;
  component: number;
  sightings: number;
  /** null: never, or not reported by this server. */
  lastSeenUtcMs: number | null;
  p: Vector3;
  q: Quaternion;
  sigmaMm: number | null;
  cov: Covariance | null;
}

export interface TagMap {
  type: 'map';
  version: number;
  family: string;
  referenceTag: number | null;
  tags: MapTag[];
}

/** Fit of a tag's recent sightings (server/scene/tag_fits.hpp). */
export interface TagFit {
  id: number;
  px: number | null;
  sightings: number;
  lastSeenUtcMs: number;
}

export interface TagFits {
  type: 'fits';
  tags: TagFit[];
}

/** One stored version of the map. */
export interface MapVersion {
  version: number;
  parent: number;
  utcMs: number;
  tags: number;
  comment: string;
}

export interface TagChange {
  id: number;
  kind: 'added' | 'removed' | 'moved';
  mm: number;
  deg: number;
  /** null where the tag is not. */
  from: Vector3 | null;
  to: Vector3 | null;
}

export interface MapDiff {
  before: number;
  after: number;
  changes: TagChange[];
}

/** Present or last pose of a body: see `BodyFrame.valid`. */
export interface BodyPose {
  p: Vector3;
  q: Quaternion;
  speed: number | null;
  sigmaMm: number | null;
  sigmaDeg: number | null;
  cov: Covariance | null;
  ageMs: number | null;
}

export interface BodyFrame {
  id: number;
  state: BodyState;
  valid: boolean;
  /** null: never anchored to the workspace. */
  pose: BodyPose | null;
  latencyMs: number | null;
  tags: number;
  imageRateHz: number | null;
  reprojectionPx: number | null;
  imagesDropped: number;
}

export interface Frame {
  type: 'frame';
  number: number;
  utcMs: number;
  rateHz: number;
  bodies: BodyFrame[];
}

export interface Client {
  protocol: string;
  peer: string;
  detail: string;
  sent: number;
  dropped: number;
  connectedS: number;
  /** Server's clock minus the client's, null: not measured. */
  clock: { offsetS: number; sigmaS: number } | null;
}

export interface Clients {
  type: 'clients';
  clients: Client[];
}

export interface LogLine {
  n: number;
  utcMs: number;
  level: LogLevel;
  module: string;
  text: string;
}

export interface Log {
  type: 'log';
  lines: LogLine[];
}

export type Severity = 'info' | 'warning' | 'error';

/** An event or condition for the user. */
export interface ServerEvent {
  n: number;
  utcMs: number;
  severity: Severity;
  subject: string;
  kind: string;
  text: string;
  /** Remedy; empty: none. */
  remedy: string;
  /** A condition ended here. */
  over: boolean;
}

export interface Events {
  type: 'events';
  /** Conditions that hold. */
  standing: ServerEvent[];
  /** Events, newest last. */
  events: ServerEvent[];
}

export type Message = Hello | Ticket | Events | TagMap | TagFits | Frame | Clients | Log;

function parsePose(body: Fields): BodyPose | null {
  const p = tuple<Vector3>(body.p, 3);
  const q = tuple<Quaternion>(body.q, 4);
  if (!p || !q) return null;
  return {
    p,
    q,
    speed: numberOrNull(body.speed),
    sigmaMm: numberOrNull(body.sigma_mm),
    sigmaDeg: numberOrNull(body.sigma_deg),
    cov: tuple<Covariance>(body.cov, 6),
    ageMs: numberOrNull(body.age_ms),
  };
}

function parseBody(value: unknown): BodyFrame {
  const body = fields(value, 'body');
  const pose = parsePose(body);
  return {
    id: number(body.id, 'body.id'),
    state: oneOf(body.state, ['searching', 'tracking', 'coasting', 'lost'] as const, 'body.state'),
    valid: body.valid === true && pose !== null,
    pose,
    latencyMs: numberOrNull(body.latency_ms),
    tags: number(body.tags, 'body.tags'),
    imageRateHz: numberOrNull(body.image_rate_hz),
    reprojectionPx: numberOrNull(body.reprojection_px),
    imagesDropped: number(body.images_dropped, 'body.images_dropped'),
  };
}

function parseTag(value: unknown): MapTag | null {
  const tag = fields(value, 'tag');
  const p = tuple<Vector3>(tag.p, 3);
  const q = tuple<Quaternion>(tag.q, 4);
  if (!p || !q) return null;
  return {
    id: number(tag.id, 'tag.id'),
    edgeM: number(tag.edge_m, 'tag.edge_m'),
    state: oneOf(tag.state, ['local', 'calibrated', 'surveyed', 'quarantined'] as const, 'tag.state'),
    component: number(tag.component, 'tag.component'),
    sightings: number(tag.sightings, 'tag.sightings'),
    lastSeenUtcMs: numberOrNull(tag.last_seen_utc_ms) || null,
    p,
    q,
    sigmaMm: numberOrNull(tag.sigma_mm),
    cov: tuple<Covariance>(tag.cov, 6),
  };
}

function parseClient(value: unknown): Client {
  const client = fields(value, 'client');
  return {
    protocol: text(client.protocol, 'client.protocol'),
    peer: text(client.peer, 'client.peer'),
    detail: text(client.detail, 'client.detail'),
    sent: number(client.sent, 'client.sent'),
    dropped: number(client.dropped, 'client.dropped'),
    connectedS: number(client.connected_s, 'client.connected_s'),
    clock: parseClock(client),
  };
}

/** Half a measurement is none. */
function parseClock(client: Fields): Client['clock'] {
  const offsetS = numberOrNull(client.clock_offset_s);
  const sigmaS = numberOrNull(client.clock_sigma_s);
  return offsetS === null || sigmaS === null ? null : { offsetS, sigmaS };
}

function parseLine(value: unknown): LogLine {
  const line = fields(value, 'line');
  return {
    n: number(line.n, 'line.n'),
    utcMs: number(line.utc_ms, 'line.utc_ms'),
    level: oneOf(line.level, ['debug', 'info', 'warning', 'error'] as const, 'line.level'),
    module: text(line.module, 'line.module'),
    text: text(line.text, 'line.text'),
  };
}

function parseEvent(value: unknown): ServerEvent {
  const event = fields(value, 'event');
  return {
    n: number(event.n, 'event.n'),
    utcMs: number(event.utc_ms, 'event.utc_ms'),
    severity: oneOf(event.severity, ['info', 'warning', 'error'] as const, 'event.severity'),
    subject: text(event.subject, 'event.subject'),
    kind: text(event.kind, 'event.kind'),
    text: text(event.text, 'event.text'),
    remedy: text(event.remedy, 'event.remedy'),
    over: event.over === true,
  };
}

/** @returns the message; null for a type this page does not know (a newer server). Throws when a known one is malformed. */
export function parseMessage(json: string): Message | null {
  const message = fields(JSON.parse(json), 'message');
  switch (message.type) {
    case 'hello':
      return {
        type: 'hello',
        server: text(message.server, 'hello.server'),
        version: text(message.version, 'hello.version'),
        mapMode: text(message.map_mode, 'hello.map_mode'),
        pageRateHz: number(message.page_rate_hz, 'hello.page_rate_hz'),
        takesCommands: message.takes_commands === true,
        bodies: list(message.bodies, 'hello.bodies', (item) => {
          const body = fields(item, 'body');
          return { id: number(body.id, 'body.id'), name: text(body.name, 'body.name') };
        }),
      };
    case 'ticket':
      return { type: 'ticket', ticket: text(message.ticket, 'ticket.ticket') };
    case 'events':
      return {
        type: 'events',
        standing: list(message.standing, 'events.standing', parseEvent),
        events: list(message.events, 'events.events', parseEvent),
      };
    case 'map':
      return {
        type: 'map',
        version: number(message.version, 'map.version'),
        family: text(message.family, 'map.family'),
        referenceTag: numberOrNull(message.reference_tag),
        tags: list(message.tags, 'map.tags', parseTag).filter((tag): tag is MapTag => tag !== null),
      };
    case 'fits':
      return {
        type: 'fits',
        tags: list(message.tags, 'fits.tags', (item) => {
          const fit = fields(item, 'fit');
          return {
            id: number(fit.id, 'fit.id'),
            px: numberOrNull(fit.px),
            sightings: number(fit.sightings, 'fit.sightings'),
            lastSeenUtcMs: number(fit.last_seen_utc_ms, 'fit.last_seen_utc_ms'),
          };
        }),
      };
    case 'frame':
      return {
        type: 'frame',
        number: number(message.number, 'frame.number'),
        utcMs: number(message.utc_ms, 'frame.utc_ms'),
        rateHz: number(message.rate_hz, 'frame.rate_hz'),
        bodies: list(message.bodies, 'frame.bodies', parseBody),
      };
    case 'clients':
      return { type: 'clients', clients: list(message.clients, 'clients', parseClient) };
    case 'log':
      return { type: 'log', lines: list(message.lines, 'log.lines', parseLine) };
    default:
      return null;
  }
}

/** The answer of `/api/v1/map/versions`, newest first. */
export function parseVersions(json: string): MapVersion[] {
  return list(fields(JSON.parse(json), 'versions').versions, 'versions', (item) => {
    const one = fields(item, 'version');
    return {
      version: number(one.version, 'version.version'),
      parent: number(one.parent, 'version.parent'),
      utcMs: number(one.utc_ms, 'version.utc_ms'),
      tags: number(one.tags, 'version.tags'),
      comment: text(one.comment, 'version.comment'),
    };
  });
}

/** The answer of `/api/v1/map/diff/A/B`. */
export function parseDiff(json: string): MapDiff {
  const diff = fields(JSON.parse(json), 'diff');
  return {
    before: number(diff.before, 'diff.before'),
    after: number(diff.after, 'diff.after'),
    changes: list(diff.changes, 'diff.changes', (item) => {
      const change = fields(item, 'change');
      return {
        id: number(change.id, 'change.id'),
        kind: oneOf(change.kind, ['added', 'removed', 'moved'] as const, 'change.kind'),
        mm: number(change.mm, 'change.mm'),
        deg: number(change.deg, 'change.deg'),
        from: tuple<Vector3>(change.from, 3),
        to: tuple<Vector3>(change.to, 3),
      };
    }),
  };
}
