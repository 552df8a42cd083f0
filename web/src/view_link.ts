import { encodeRequest, parseReply, RESULT } from './control_codec';
import { retryDelay } from './connection';
import { reader } from './reader';
import { parsePicture, parseViewList, requestText, type ViewList, type ViewPicture, type PictureRequest } from './view_protocol';

/** `api/v1/views` beside the page, also below a path of a proxy. */
export function viewsUrl(page: string): string {
  return new URL('api/v1/views', page).href;
}

export interface ViewLinkEvents {
  picture(picture: ViewPicture): void;
  /** Why there are no pictures; empty: there are. */
  trouble(words: string): void;
}

const SETTLE_MS = 150; // scrolling past tiles requests nothing

/** The socket of the pictures: open only while some are requested. */
export class ViewLink {
  private socket: WebSocket | null = null;
  private admitted = false;
  private requests: PictureRequest[] = [];
  private sent = '';
  private failures = 0;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(
    private readonly url: string,
    private readonly events: ViewLinkEvents,
    private readonly token: () => string | null,
  ) {}

  /** Cameras that this client may see; never throws. */
  async list(): Promise<ViewList | null> {
    try {
      const answer = await reader.fetch(this.url, { cache: 'no-store' });
      return answer.ok ? parseViewList(await answer.text()) : null;
    } catch {
      return null;
    }
  }

  request(requests: PictureRequest[]): void {
    this.requests = requests;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.act(), SETTLE_MS);
  }

  private act(): void {
    if (this.requests.length === 0) return this.hangUp();
    if (!this.socket) return this.open();
    if (this.admitted) this.send();
  }

  private send(): void {
    const words = requestText(this.requests);
    if (words === this.sent) return;
    this.sent = words;
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
    this.sent = '';
    const token = this.token();
    this.admitted = token === null;
    socket.onopen = () => {
      if (this.admitted) this.send();
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
    if (this.admitted) return this.send();
    this.requests = []; // repeated attempts would lock the operator out
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
    this.events.trouble(reason || 'No pictures: the server is not reachable, or too many clients watch its cameras. Trying again …');
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.act(), retryDelay(this.failures));
  }
}
