import { describe, expect, it } from 'vitest';
import type { Question } from '../src/ask';
import { encodeRequest } from '../src/control_codec';
import { parseMessage } from '../src/protocol';
import { Reader } from '../src/reader';

/** A message of the server: its length, then `fields` of a ControlReply. */
function message(fields: number[]): ArrayBuffer {
  return new Uint8Array([fields.length, 0, 0, 0, ...fields]).buffer;
}

// proto/fiducap/v1/control.proto: hello is field 4, its challenge field 1; the result is field 2.
const CHALLENGE = Array.from({ length: 32 }, (_, i) => i);
const challenge = message([0x22, 34, 0x0a, 32, ...CHALLENGE]);
const forbidden = message([0x10, 2]);

describe('Reader', () => {
  it('asks once for the token, proves it, and asks again after a wrong one', async () => {
    const questions: Question[] = [];
    const answers = ['a guess', 'may only look'];
    const reader = new Reader((question) => {
      questions.push(question);
      return Promise.resolve(answers[questions.length - 1] ?? null);
    });
    const sent: Uint8Array[] = [];
    const send = (bytes: Uint8Array): void => void sent.push(bytes);
    await Promise.all([reader.prove(challenge, send), reader.prove(challenge, send)]);
    expect(questions.length).toBe(1);
    expect(questions[0]?.field?.secret).toBe(true);
    const proof = encodeRequest('a guess', new Uint8Array(CHALLENGE), 1, { do: 'check' });
    expect(sent).toEqual([proof, proof]);
    await reader.prove(forbidden, send);
    await reader.prove(challenge, send);
    expect(questions.length).toBe(2);
    expect(questions[1]?.text).toContain('Not accepted');
    expect(reader.token).toBe('may only look');
    expect(sent.length).toBe(3);
  });

  it('sends nothing when no token is typed', async () => {
    const reader = new Reader(() => Promise.resolve(null));
    await reader.prove(challenge, () => expect.unreachable());
    await reader.prove(challenge, () => expect.unreachable());
  });
});

describe('parseMessage', () => {
  it('reads a ticket', () => {
    expect(parseMessage('{"type":"ticket","ticket":"00ff"}')).toEqual({ type: 'ticket', ticket: '00ff' });
  });
});
