import { encodeRequest, parseReply, RESULT } from './control_codec';
import { retryDelay } from './connection';
import { parsePicture, parseViewList, wishText, type ViewList, type ViewPicture, type Wish } from './view_protocol';

/** `api/v1/views` beside the page, also below a path of a proxy. */
export function viewsUrl(page: string): string {
  return new URL('api/v1/views', page).href;
}

export interface ViewLinkEvents {
  picture(picture: ViewPicture): void;
  /** Why nothing comes; empty: all is well. */
  trouble(words: string): void;
}

const SAME_WISH_MS = 150; // scrolling past tiles is no wish

/** The socket of the pictures: open while something is wished, and no longer. */
export class ViewLink {
  private socket: WebSocket | null = null;
  private admitted = false;
  private wishes: Wish[] = [];
  private told = '';
  private failures = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly url: string,
    private readonly events: ViewLinkEvents,
    private readonly token: () => string | null,
  ) {}

  /** Who may look, and at what; never throws. */
  async list(): Promise<ViewList | null> {
    try {
      const answer = await fetch(this.url, { cache: 'no-store' });
      return answer.ok ? parseViewList(await answer.text()) : null;
    } catch {
      return null;
    }
  }

  wish(wishes: Wish[]): void {
    this.wishes = wishes;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.act(), SAME_WISH_MS);
  }

  private act(): void {
    if (this.wishes.length === 0) return this.hangUp();
    if (!this.socket) return this.open();
    if (this.admitted) this.tell();
  }

  private tell(): void {
    const words = wishText(this.wishes);
    if (words === this.told) return;
    this.told = words;
    this.socket?.send(words);
  }

  private hangUp(): void {
    const { socket } = this;
    this.socket = null;
    socket?.close();
  }

  private open(): void {
    const url = new URL(this.url);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    const socket = new WebSocket(url.href);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.told = '';
    const token = this.token();
    this.admitted = token === null;
    socket.onopen = () => {
      if (this.admitted) this.tell();
    };
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket) return;
      if (this.admitted) return this.show(data as ArrayBuffer);
      this.prove(socket, token ?? '', data as ArrayBuffer);
    };
    socket.onclose = ({ reason }) => this.closed(socket, reason);
  }

  private prove(socket: WebSocket, token: string, data: ArrayBuffer): void {
    const reply = parseReply(data);
    if (reply.challenge) return socket.send(encodeRequest(token, reply.challenge, 1, { do: 'check' }));
    this.admitted = reply.result === RESULT.done;
    if (this.admitted) return this.tell();
    this.wishes = []; // asking again and again would shut the operator out
    this.hangUp();
    this.events.trouble(`No pictures: ${reply.text}.`);
  }

  private show(data: ArrayBuffer): void {
    this.failures = 0;
    this.events.trouble('');
    this.events.picture(parsePicture(data));
  }

  private closed(socket: WebSocket, reason: string): void {
    if (socket !== this.socket) return;
    this.socket = null;
    this.failures += 1;
    this.events.trouble(reason || 'No pictures: the server is away, or too many watch its cameras already. Trying again …');
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.act(), retryDelay(this.failures));
  }
}
