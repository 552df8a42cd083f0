// Steps that watch until they have enough: lens, rest, wave.
import { ask } from '../ask';
import { element, setText } from '../dom';
import { plural } from '../format';
import { button } from '../map_commands';
import {
  afterVerdict, column, Progress, VerdictBox, verdictHint, type StepContext, type Primary, type StepView,
} from './parts';
import type { Lens, SetupState } from './protocol';

const GUESS =
  'A typical lens is assumed, and the rest is estimated while the robot moves. Until then ' +
  'poses can be wrong by centimetres and more, and strong distortion may never be estimated. ' +
  'Use it for a first try; calibrate before you rely on a pose.';

export class LensView implements StepView {
  readonly root: HTMLElement;
  private readonly covered = new Progress('Image covered');
  private readonly counts = element('p', 'counts');
  private readonly legend = element('p', 'field-why');
  private readonly skip = button('Continue without calibrating…', 'Assume a typical lens', () => {
    void this.guess();
  });
  private readonly verdict = new VerdictBox();

  constructor(private readonly context: StepContext) {
    setText(this.legend, 'Green with a tick: covered. Amber: show it there once more.');
    this.root = column(
      this.verdict.root, this.covered.root, this.counts, this.legend, this.skip,
    );
  }

  hint(state: SetupState): string {
    if (state.solving) return 'Enough is seen. Computing the lens …';
    return verdictHint(state.verdict) || (state.lens?.hint ?? '');
  }

  update({ lens, verdict }: SetupState): void {
    this.covered.set(lens?.covered ?? 0, lens ? coveredWords(lens) : '');
    const [views, tilted] = [lens?.views ?? 0, lens?.tilted ?? 0];
    setText(this.counts, `${plural(views, 'view', 'views')} taken, ${tilted} of them tilted`);
    this.verdict.show(verdict);
    this.legend.hidden = verdict?.good === true;
    // A measured lens is better than an assumed one.
    this.skip.hidden = verdict !== null && !verdict.refused;
  }

  primary(state: SetupState): Primary {
    return afterVerdict(state);
  }

  private async guess(): Promise<void> {
    const question = { title: 'Continue without calibrating?', text: GUESS, yes: 'Assume a typical lens' };
    if ((await ask(question)) !== null) this.context.run([{ name: 'guess' }]);
  }
}

/** `43 %`, for any number of cells. */
function coveredWords(lens: Lens): string {
  return `${Math.floor(100 * lens.covered)} %`;
}

export class RestView implements StepView {
  readonly root: HTMLElement;
  private readonly share = new Progress('Time at rest');
  private readonly verdict = new VerdictBox();

  constructor() {
    this.root = column(this.verdict.root, this.share.root);
  }

  hint({ rest, solving, verdict }: SetupState): string {
    if (solving) return 'Long enough. Computing the noise …';
    return verdictHint(verdict) || (rest?.hint ?? '');
  }

  update({ rest, verdict }: SetupState): void {
    this.share.set(rest?.share ?? 0);
    this.verdict.show(verdict);
  }

  primary(state: SetupState): Primary {
    return afterVerdict(state, 'Continue without measuring');
  }
}

export class WaveView implements StepView {
  readonly root: HTMLElement;
  private readonly turned = [
    new Progress('Roll: lean left and right'),
    new Progress('Pitch: nose up and down'),
    new Progress('Yaw: turn left and right'),
  ];
  private readonly shaken = new Progress('Shaken quickly to and fro');
  private readonly seen = new Progress('With tags in view');
  private readonly verdict = new VerdictBox();

  constructor() {
    const bars = [...this.turned, this.shaken, this.seen].map((bar) => bar.root);
    this.root = column(this.verdict.root, ...bars);
  }

  hint({ wave, solving, verdict }: SetupState): string {
    if (solving) return 'Enough. Computing the poses of camera and IMU, for up to a minute …';
    return verdictHint(verdict) || (wave?.hint ?? '');
  }

  update({ wave, verdict }: SetupState): void {
    this.turned.forEach((bar, i) => bar.set(wave?.turned[i] ?? 0));
    this.shaken.set(wave?.shaken ?? 0);
    this.seen.set(wave?.seen ?? 0);
    this.verdict.show(verdict);
  }

  primary(state: SetupState): Primary {
    return afterVerdict(state, 'Continue without waving');
  }
}
