import type { BodyFrame, BodyState } from './protocol';

const HOLD_MS = 1000;
const RANK: Record<BodyState, number> = { tracking: 0, coasting: 1, searching: 2, lost: 3 };

/** A body whose state holds for long enough to be read. */
export interface ShownBody extends BodyFrame {
  /** How long it has been so; null: since before this page looked. */
  stateAgeMs: number | null;
}

interface Kept {
  state: BodyState;
  sinceMs: number | null;
  /** Since when a better one has held. */
  betterMs: number | null;
}

/** A worse state is shown at once, a better one after it has held for a second. */
export class SteadyStates {
  private readonly kept = new Map<number, Kept>();

  /** @param utcMs  of the frame */
  take(bodies: BodyFrame[], utcMs: number): ShownBody[] {
    return bodies.map((body) => this.takeOne(body, utcMs));
  }

  private takeOne(body: BodyFrame, utcMs: number): ShownBody {
    const { id, state } = body;
    const kept = this.kept.get(id) ?? { state, sinceMs: null, betterMs: null };
    this.kept.set(id, kept);
    if (RANK[state] >= RANK[kept.state]) kept.betterMs = null;
    else kept.betterMs ??= utcMs;
    const isSettled = kept.betterMs !== null && utcMs - kept.betterMs >= HOLD_MS;
    if (RANK[state] > RANK[kept.state] || isSettled)
      Object.assign(kept, { state, sinceMs: kept.betterMs ?? utcMs, betterMs: null });
    // Without a tag it is as old as the last one.
    const unseenMs = kept.state === 'coasting' || kept.state === 'lost' ? (body.pose?.ageMs ?? null) : null;
    return { ...body, state: kept.state, stateAgeMs: kept.sinceMs === null ? unseenMs : Math.max(0, utcMs - kept.sinceMs) };
  }
}
