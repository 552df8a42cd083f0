// Whether a person is in the second half of the set-up, which goes on on the normal page.
import { fields, number, text } from '../fields';

const KEY = 'fiducap.setup';
/** Where the camera sits, as typed; void once the set-up is done. */
export const TYPED_MOUNT = 'fiducap.setup.mount';

export interface SecondHalf {
  /** The configuration. */
  file: string;
  /** Which of its steps, from 0. */
  at: number;
}

/** null: nobody is in it, or what was remembered is not understood. */
export function remembered(): SecondHalf | null {
  const kept = sessionStorage.getItem(KEY);
  if (kept === null) return null;
  try {
    const half = fields(JSON.parse(kept), KEY);
    return { file: text(half.file, 'file'), at: number(half.at, 'at') };
  } catch {
    return null;
  }
}

export function remember(half: SecondHalf): void {
  sessionStorage.removeItem(TYPED_MOUNT);
  sessionStorage.setItem(KEY, JSON.stringify(half));
}

export function forget(): void {
  sessionStorage.removeItem(KEY);
}

/** A server that does not answer in time is not being set up. */
export async function isSetupGoingOn(page: string): Promise<boolean> {
  const hurry = new AbortController();
  const timer = setTimeout(() => hurry.abort(), 2000);
  const url = new URL('api/v1/setup', page);
  const answer = await fetch(url, { cache: 'no-store', signal: hurry.signal }).catch(() => null);
  clearTimeout(timer);
  return answer?.status === 200;
}

/** A list of words that was kept as JSON; empty when it is none. */
export function keptWords(kept: string | null): string[] {
  try {
    const words: unknown = JSON.parse(kept ?? '[]');
    return Array.isArray(words) ? words.map(String) : [];
  } catch {
    return [];
  }
}
