// The few messages of the control channel that this page uses (proto/fiducap/v1/control.proto), by hand: the
// runtime of protobuf weighs more than the page's own code.
import { concat, hmacSha256 } from './hmac';
import type { Vector3 } from './protocol';

export interface MeasuredPlace {
  tag: number;
  p: Vector3;
}

export type Command =
  | { do: 'check' }
  | { do: 'freeze' }
  | { do: 'grow' }
  | { do: 'commit'; name: string }
  | { do: 'name'; version: number; name: string }
  | { do: 'rollback'; version: number }
  | { do: 'align'; places: MeasuredPlace[] }
  | { do: 'quarantine'; tag: number }
  | { do: 'forget'; tag: number };

export interface Reply {
  result: number;
  text: string;
  /** Of the server's first message; else null. */
  challenge: Uint8Array | null;
}

export const RESULT = { done: 0, refused: 1, forbidden: 2 } as const;

const PURPOSE = utf8('fiducap control v1\0');
const NOTHING = new Uint8Array(0);

function utf8(text: string): Uint8Array {
  return new TextEncoder().encode(text);
}

function varint(value: number): Uint8Array {
  const bytes: number[] = [];
  let rest = value;
  for (; rest >= 128; rest = Math.floor(rest / 128)) bytes.push((rest % 128) | 128);
  return Uint8Array.of(...bytes, rest);
}

const number = (field: number, value: number): Uint8Array => concat(Uint8Array.of(field << 3), varint(value));
const bytes = (field: number, value: Uint8Array): Uint8Array =>
  concat(Uint8Array.of((field << 3) | 2), varint(value.length), value);

function fixed64(value: number): Uint8Array {
  const view = new DataView(new ArrayBuffer(8));
  view.setUint32(0, value >>> 0, true);
  view.setUint32(4, Math.floor(value / 2 ** 32), true);
  return new Uint8Array(view.buffer);
}

/** A serialised ControlCommand. */
export function encodeCommand(command: Command): Uint8Array {
  switch (command.do) {
    case 'check':
      return bytes(1, NOTHING);
    case 'freeze':
      return bytes(5, NOTHING);
    case 'grow':
      return bytes(5, number(1, 1));
    case 'commit':
      return bytes(6, bytes(1, utf8(command.name)));
    case 'name':
      return bytes(9, concat(number(1, command.version), bytes(2, utf8(command.name))));
    case 'rollback':
      return bytes(10, number(1, command.version));
    case 'align':
      return bytes(11, concat(...command.places.map((place) => bytes(1, measured(place)))));
    case 'quarantine':
      return bytes(12, number(1, command.tag));
    case 'forget':
      return bytes(13, number(1, command.tag));
  }
}

function measured({ tag, p }: MeasuredPlace): Uint8Array {
  const view = new DataView(new ArrayBuffer(24));
  p.forEach((x, i) => view.setFloat64(8 * i, x, true));
  return concat(number(1, tag), bytes(2, new Uint8Array(view.buffer)));
}

/** A ControlRequest behind its length, with a proof of the token, which is not in it. */
export function encodeRequest(token: string, challenge: Uint8Array, sequence: number, command: Command): Uint8Array {
  const place = fixed64(sequence);
  const body = encodeCommand(command);
  const proof = hmacSha256(utf8(token), concat(PURPOSE, challenge, place, body));
  const request = concat(Uint8Array.of(0x09), place, bytes(2, proof), bytes(3, body));
  const length = new DataView(new ArrayBuffer(4));
  length.setUint32(0, request.length, true);
  return concat(new Uint8Array(length.buffer), request);
}

/** A ControlReply behind its length. Throws when it is none. */
export function parseReply(message: ArrayBuffer): Reply {
  const fields = new Fields(new Uint8Array(message, 4));
  const reply: Reply = { result: RESULT.done, text: '', challenge: null };
  for (let key = fields.key(); key !== null; key = fields.key()) {
    const value = fields.value(key & 7);
    const field = key >> 3;
    if (field === 2 && typeof value === 'number') reply.result = value;
    if (field === 3 && typeof value === 'object') reply.text = new TextDecoder().decode(value);
    if (field === 4 && typeof value === 'object') {
      const hello = new Fields(value);
      if (hello.key() === 10) reply.challenge = hello.value(2) as Uint8Array;
    }
  }
  return reply;
}

/** Reads protobuf: a key, then its value, until the end. */
class Fields {
  private at = 0;
  constructor(private readonly data: Uint8Array) {}

  key(): number | null {
    return this.at < this.data.length ? this.varint() : null;
  }

  value(type: number): number | Uint8Array {
    if (type === 0) return this.varint();
    const size = type === 1 ? 8 : type === 5 ? 4 : type === 2 ? this.varint() : Infinity;
    if (this.at + size > this.data.length) throw new Error('a reply that ends too early');
    this.at += size;
    return this.data.subarray(this.at - size, this.at);
  }

  private varint(): number {
    let value = 0;
    for (let unit = 1; unit < 2 ** 63; unit *= 128) {
      const byte = this.data[this.at++];
      if (byte === undefined) throw new Error('a reply that ends too early');
      value += (byte & 127) * unit;
      if (byte < 128) return value;
    }
    throw new Error('a number of a reply that does not end');
  }
}
