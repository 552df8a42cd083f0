// Whether the second half of the set-up, on the normal page, is in progress.
import { fields, number, text } from '../fields';

const KEY = 'fiducap.setup';
const SECRET = 'fiducap.setup.secret';
/** Where the camera sits, as typed; void once the set-up is done. */
export const TYPED_MOUNT = 'fiducap.setup.mount';

export interface SecondHalf {
  /** The configuration. */
  file: string;
  /** Which of its steps, from 0. */
  at: number;
}

/** null: it is not, or the stored text is invalid. */
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

/** The text after # in the address that `fiducapd --setup` prints; null: no secret. */
export function secretIn(hash: string): string | null {
  return /^#([0-9a-f]{32})$/.exec(hash)?.[1] ?? null;
}

/** Keeps the secret of the address for this tab, and takes it out of the address bar. @returns whether there was one */
export function keepSecret(): boolean {
  const secret = secretIn(location.hash);
  if (secret === null) return false;
  sessionStorage.setItem(SECRET, secret);
  history.replaceState(null, '', location.pathname + location.search);
  return true;
}

/** Proves to the server that the page was opened by the printed address. */
export function setupHeaders(): Record<string, string> {
  return { 'X-Fiducap-Setup': sessionStorage.getItem(SECRET) ?? '' };
}

/** The state of a server that is not being set up. */
export const NO_SETUP = 'null';

export interface SetupAnswer {
  isGoingOn: boolean;
  /** Why this page may not lead the set-up; empty: it may, or there is none. */
  refusal: string;
}

/** A server that does not answer in time is not being set up. */
export async function askForSetup(page: string): Promise<SetupAnswer> {
  const hurry = new AbortController();
  const timer = setTimeout(() => hurry.abort(), 2000);
  const url = new URL('api/v1/setup', page);
  const wanted = { cache: 'no-store' as const, signal: hurry.signal, headers: setupHeaders() };
  const answer = await fetch(url, wanted).catch(() => null);
  const words = answer ? (await answer.text().catch(() => '')).trim() : '';
  clearTimeout(timer);
  const isGoingOn = answer?.status === 200 && words !== NO_SETUP;
  return { isGoingOn, refusal: answer?.status === 403 ? words : '' };
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
