import { describe, expect, it } from 'vitest';
import { encodeCommand, encodeRequest, parseReply } from '../src/control_codec';
import { hmacSha256, sha256 } from '../src/hmac';

const utf8 = (text: string): Uint8Array => new TextEncoder().encode(text);
const hex = (bytes: Uint8Array): string => [...bytes].map((byte) => byte.toString(16).padStart(2, '0')).join('');

describe('sha256', () => {
  it('is that of the standard', () => {
    expect(hex(sha256(utf8('')))).toBe('e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855');
    expect(hex(sha256(utf8('abc')))).toBe('ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad');
    expect(hex(sha256(utf8('abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq')))).toBe(
      '248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1',
    );
    expect(hex(sha256(new Uint8Array(1000).fill(0x61)))).toBe('41edece42d63e8d9bf515a9ba6932e1c20cbc9f5a5d134645adb5db1b9737ea3');
  });
});

describe('hmacSha256', () => {
  it('is that of RFC 4231, also with a key longer than a block', () => {
    expect(hex(hmacSha256(utf8('Jefe'), utf8('what do ya want for nothing?')))).toBe(
      '5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843',
    );
    const long = new Uint8Array(131).fill(0xaa);
    expect(hex(hmacSha256(long, utf8('Test Using Larger Than Block-Size Key - Hash Key First')))).toBe(
      '60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54',
    );
  });
});

// As protobuf writes control.proto.
describe('encodeCommand', () => {
  it('writes every command', () => {
    expect(hex(encodeCommand({ do: 'check' }))).toBe('0a00');
    expect(hex(encodeCommand({ do: 'freeze' }))).toBe('2a00');
    expect(hex(encodeCommand({ do: 'grow' }))).toBe('2a020801');
    expect(hex(encodeCommand({ do: 'commit', name: 'é' }))).toBe('32040a02c3a9');
    expect(hex(encodeCommand({ do: 'name', version: 300, name: 'a' }))).toBe('4a0608ac02120161');
    expect(hex(encodeCommand({ do: 'rollback', version: 7 }))).toBe('52020807');
    expect(hex(encodeCommand({ do: 'quarantine', tag: 0 }))).toBe('62020800');
    expect(hex(encodeCommand({ do: 'forget', tag: 586 }))).toBe('6a0308ca04');
    expect(hex(encodeCommand({ do: 'align', places: [{ tag: 4, p: [1, 0, -2] }] }))).toBe(
      '5a1e0a1c08041218000000000000f03f000000000000000000000000000000c0',
    );
  });
});

describe('encodeRequest', () => {
  it('has its length before it, proof and body in it, and not the token', () => {
    const request = encodeRequest('correct horse', new Uint8Array(32), 1, { do: 'freeze' });
    expect(new DataView(request.buffer).getUint32(0, true)).toBe(request.length - 4);
    expect(hex(request.subarray(4, 15))).toBe('0901000000000000001220');
    expect(hex(request.subarray(request.length - 4))).toBe('1a022a00');
    expect(hex(request)).not.toContain(hex(utf8('correct')));
  });
});

describe('parseReply', () => {
  const reply = (...bytes: number[]): ArrayBuffer => Uint8Array.of(bytes.length, 0, 0, 0, ...bytes).buffer;

  it('reads a challenge, a refusal, and passes over what it does not know', () => {
    expect(parseReply(reply(0x22, 3, 0x0a, 1, 9)).challenge).toEqual(Uint8Array.of(9));
    const refused = parseReply(reply(0x09, 1, 0, 0, 0, 0, 0, 0, 0, 0x10, 1, 0x1a, 2, 0x6e, 0x6f, 0x7a, 1, 5));
    expect(refused).toEqual({ result: 1, text: 'no', challenge: null });
  });

  it('takes nothing that ends too early', () => {
    expect(() => parseReply(reply(0x1a, 200))).toThrow();
    expect(() => parseReply(reply(0x10, 0x80))).toThrow();
    expect(() => parseReply(reply(0x0b))).toThrow();
  });
});
