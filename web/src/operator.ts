import { encodeRequest, parseReply, RESULT, type Command } from './control_codec';

// A server that takes longer has closed the connection unnoticed.
const TIMEOUT_MS = 15_000;

export interface Outcome {
  done: boolean;
  /** The token is not the server's. */
  forbidden: boolean;
  /** Message of the server; empty: accepted. */
  text: string;
}

/** `ws://` beside the page, also below a path of a proxy. */
export function controlUrl(page: string): string {
  const url = new URL('api/v1/control', page);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  return url.href;
}

/** One command on a connection of its own: challenge, proof, answer. Never throws. */
export function command(url: string, token: string, wanted: Command): Promise<Outcome> {
  return new Promise((resolve) => {
    const socket = new WebSocket(url);
    socket.binaryType = 'arraybuffer';
    const end = (outcome: Outcome): void => {
      clearTimeout(timer);
      socket.onmessage = socket.onclose = null;
      socket.close();
      resolve(outcome);
    };
    const failed = (text: string): void => end({ done: false, forbidden: false, text });
    const timer = setTimeout(() => failed('the server does not answer'), TIMEOUT_MS);
    socket.onclose = () => failed('the server accepted no command: it is not reachable, or overloaded');
    socket.onmessage = (event) => {
      try {
        const reply = parseReply(event.data as ArrayBuffer);
        if (reply.challenge) return socket.send(encodeRequest(token, reply.challenge, 1, wanted));
        end({ done: reply.result === RESULT.done, forbidden: reply.result === RESULT.forbidden, text: reply.text });
      } catch (error) {
        failed(String(error));
      }
    };
  });
}
