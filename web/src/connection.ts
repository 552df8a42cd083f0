import { parseMessage, type Message } from './protocol';
import { reader } from './reader';

export type LinkState = 'connecting' | 'live' | 'stale' | 'offline';

export interface ConnectionEvents {
  /** A new socket: everything comes again from the start. */
  opened(): void;
  message(message: Message): void;
  /** @param silentMs since the last frame; null before the first */
  link(state: LinkState, silentMs: number | null): void;
}

const FIRST_RETRY_MS = 500;
const LONGEST_RETRY_MS = 5000;
const STALE_AFTER_MS = 1500;
// The server sends its clients every second: a socket silent for this long is dead even without an error.
const DEAD_AFTER_MS = 6000;
const WATCH_MS = 250;

/** Delay before attempt number `failures` (from 1). */
export function retryDelay(failures: number): number {
  return Math.min(LONGEST_RETRY_MS, FIRST_RETRY_MS * 2 ** (failures - 1));
}

/** `ws://` beside the page, also below a path of a proxy. */
export function liveUrl(page: string): string {
  const url = new URL('api/v1/live', page);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  return url.href;
}

/** The live socket: reconnects by itself and reports the age of the newest frame. */
export class Connection {
  private socket: WebSocket | null = null;
  private failures = 0;
  private lastMessageAt = 0;
  private lastFrameAt: number | null = null;
  private malformed = 0;

  constructor(
    private readonly url: string,
    private readonly events: ConnectionEvents,
  ) {}

  start(): void {
    this.open();
    setInterval(() => this.watch(), WATCH_MS);
    // A tab that was asleep has a dead socket; do not wait for the timers.
    document.addEventListener('visibilitychange', () => {
      if (!document.hidden) this.watch();
    });
  }

  private open(): void {
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.lastMessageAt = performance.now();
    socket.onopen = () => this.events.opened();
    socket.onmessage = (event) => this.receive(socket, event);
    socket.onclose = () => this.closed(socket);
  }

  private receive(socket: WebSocket, event: MessageEvent): void {
    if (socket !== this.socket) return;
    this.lastMessageAt = performance.now();
    if (event.data instanceof ArrayBuffer) return void reader.prove(event.data, (bytes) => socket.send(bytes));
    if (typeof event.data !== 'string') return;
    let message: Message | null = null;
    try {
      message = parseMessage(event.data);
    } catch (error) {
      // Once is enough to find the fault; a wall screen must not fill its console.
      if (this.malformed++ === 0) console.warn('message of the server not understood:', error);
    }
    if (!message) return;
    this.failures = 0;
    if (message.type === 'ticket') return reader.setTicket(message.ticket);
    if (message.type === 'frame') this.lastFrameAt = this.lastMessageAt;
    this.events.message(message);
    if (message.type === 'frame') this.report();
  }

  private closed(socket: WebSocket): void {
    if (socket !== this.socket) return;
    this.socket = null;
    this.failures += 1;
    this.report();
    setTimeout(() => this.open(), retryDelay(this.failures));
  }

  private watch(): void {
    const socket = this.socket;
    if (socket && performance.now() - this.lastMessageAt > DEAD_AFTER_MS) {
      socket.close();
      this.closed(socket);
    }
    this.report();
  }

  private report(): void {
    const silent = this.lastFrameAt === null ? null : performance.now() - this.lastFrameAt;
    const open = this.socket?.readyState === WebSocket.OPEN;
    if (open && silent !== null && silent < STALE_AFTER_MS) return this.events.link('live', silent);
    if (open) return this.events.link(silent === null ? 'connecting' : 'stale', silent);
    this.events.link(this.failures === 0 ? 'connecting' : 'offline', silent);
  }
}
