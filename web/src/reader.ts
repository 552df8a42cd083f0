import { ask } from './ask';
import { encodeRequest, parseReply, RESULT } from './control_codec';

const TEXT =
  'Reading needs a token of this server: that for reading, or the operator’s. It stays in this tab; only a proof that you know it is sent.';

/** The right to read, of a server that asks for a token: proofs on the live socket, and its ticket for requests. */
export class Reader {
  private key: string | null = null;
  private asking: Promise<string | null> | null = null;
  private ticket = '';

  constructor(private readonly prompt: typeof ask = ask) {}

  /** Once it was typed. */
  get token(): string | null {
    return this.key;
  }

  setTicket(ticket: string): void {
    this.ticket = ticket;
  }

  /** Replies to a message of the server before the first frame. @param send  to the same socket, which may be closed by then */
  async prove(data: ArrayBuffer, send: (bytes: Uint8Array) => void): Promise<void> {
    const reply = parseReply(data);
    if (reply.challenge) {
      const token = this.key ?? (await (this.asking ??= this.askFor('')));
      if (token !== null) send(encodeRequest(token, reply.challenge, 1, { do: 'check' }));
    } else if (reply.result === RESULT.forbidden) {
      this.key = null; // repeated attempts would lock the address out
      this.asking = this.askFor(`Not accepted: ${reply.text}. `);
    }
  }

  /** A request with the right to read. */
  fetch(url: URL | string, init: RequestInit = {}): Promise<Response> {
    return fetch(url, this.ticket === '' ? init : { ...init, headers: { Authorization: `Bearer ${this.ticket}` } });
  }

  private async askFor(before: string): Promise<string | null> {
    const question = { title: 'A token is needed', text: before + TEXT, yes: 'Read', field: { label: 'Token', required: true, secret: true } };
    this.key = await this.prompt(question);
    return this.key;
  }
}

export const reader = new Reader();
