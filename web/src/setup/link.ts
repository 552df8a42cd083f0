import { NO_SETUP, setupHeaders } from './memory';
import { parseSetup, type SetupState } from './protocol';

const LOOK_MS = 250;
// With pictures: at most six a second.
const PICTURE_MS = 170;
const TIMEOUT_MS = 8000;

/** In a row: `next` is sent once `settings` was taken. */
export interface SetupCommand {
  name: string;
  values?: Record<string, string>;
}

export interface SetupListener {
  state(state: SetupState): void;
  /** The server does not answer. @param silentMs  since its last answer */
  silent(silentMs: number): void;
  /** The set-up is over: the server runs, or was started without one. */
  over(): void;
  /** Why a command was refused, or nothing. */
  refused(words: string): void;
  picture(picture: ImageBitmap): void;
}

/** `camera?open=%2Fdev%2Fvideo0` */
export function commandPath({ name, values }: SetupCommand): string {
  const query = new URLSearchParams(values ?? {}).toString();
  return query === '' ? name : `${name}?${query}`;
}

/** Polls the state and the pictures of the set-up, and sends the user's commands. */
export class SetupLink {
  private answeredAt = performance.now();
  private isStopped = false;
  private wantsPictures = false;
  private states = 0;
  /** The newest answer was not understood. */
  private isStrange = false;
  private waiting: (() => void)[] = [];
  private newest: SetupState | null = null;

  constructor(
    private readonly page: string,
    private readonly listener: SetupListener,
  ) {}

  start(): void {
    void this.look();
  }

  stop(): void {
    this.isStopped = true;
  }

  /** Pictures are expensive: only while one is shown. */
  requestPictures(wanted: boolean): void {
    this.wantsPictures = wanted;
  }

  /** One after the other; ends with the first that is refused. @returns whether all were taken */
  async run(commands: SetupCommand[]): Promise<boolean> {
    this.listener.refused('');
    for (const wanted of commands) {
      const why = await this.post(wanted);
      if (why !== '') {
        this.listener.refused(why);
        return false;
      }
      // Its result is in a state that was requested after it.
      await this.nextState();
      if (this.newest?.error) return false;
    }
    return true;
  }

  /** @returns why not; empty: it was taken */
  private async post(wanted: SetupCommand): Promise<string> {
    const answer = await this.ask(`api/v1/setup/${commandPath(wanted)}`, {
      method: 'POST',
    });
    if (!answer) return 'The server did not answer. Is it still running?';
    if (answer.ok) return '';
    const words = (await answer.text().catch(() => '')).trim();
    return words === '' ? `The server refused this (status ${answer.status}).` : words;
  }

  private nextState(): Promise<void> {
    const after = this.states + 1; // one that is on its way does not contain the command
    return new Promise((resolve) => {
      const look = (): void => {
        if (this.states > after || this.isStopped) resolve();
        else this.waiting.push(look);
      };
      look();
    });
  }

  private async look(): Promise<void> {
    while (!this.isStopped) {
      const askedAt = performance.now();
      const period = this.wantsPictures ? PICTURE_MS : LOOK_MS;
      if (!document.hidden) await this.lookOnce();
      await pause(period - (performance.now() - askedAt));
    }
  }

  /** The picture is asked for together with the state, whose outlines lie over it. */
  private async lookOnce(): Promise<void> {
    const coming = this.wantsPictures ? this.lookAtPicture() : null;
    const answer = await this.ask('api/v1/setup');
    const picture = await coming;
    if (this.isStopped) return;
    if (picture) this.listener.picture(picture);
    const json = answer?.ok ? await answer.text().catch(() => null) : null;
    // 403: the server was restarted and has another secret.
    if (json === NO_SETUP || answer?.status === 403) return this.listener.over();
    if (json === null) return this.listener.silent(performance.now() - this.answeredAt);
    this.answeredAt = performance.now();
    this.read(json);
  }

  private read(json: string): void {
    try {
      this.newest = parseSetup(json);
      if (this.isStrange) this.listener.refused('');
      this.isStrange = false;
    } catch (error) {
      this.isStrange = true;
      return this.listener.refused(
        `This page does not understand the server: ${(error as Error).message}. Load it again.`,
      );
    }
    this.states += 1;
    this.listener.state(this.newest);
    for (const wake of this.waiting.splice(0)) wake();
  }

  private async lookAtPicture(): Promise<ImageBitmap | null> {
    const answer = await this.ask('api/v1/setup/picture');
    const jpeg = answer?.ok ? await answer.blob().catch(() => null) : null;
    // Half a picture is none; the next one comes soon.
    return jpeg ? createImageBitmap(jpeg).catch(() => null) : null;
  }

  private async ask(path: string, options: RequestInit = {}): Promise<Response | null> {
    const hurry = new AbortController();
    const timer = setTimeout(() => hurry.abort(), TIMEOUT_MS);
    const common = { cache: 'no-store' as const, signal: hurry.signal, headers: setupHeaders() };
    const wanted = { ...common, ...options };
    const answer = await fetch(new URL(path, this.page), wanted).catch(() => null);
    clearTimeout(timer);
    return answer;
  }
}

function pause(ms: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, Math.max(0, ms)));
}
