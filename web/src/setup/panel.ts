import { element, setText } from '../dom';
import { button } from '../map_commands';
import { SetupLink, type SetupCommand } from './link';
import { remember } from './memory';
import { drawPicture, pictureWords } from './overlay';
import { AGAIN, ifComplete, judge, type StepContext, type Primary, type StepView } from './parts';
import type { SetupState, StepName } from './protocol';
import { CameraView, PictureView } from './view_camera';
import { FinishView } from './view_finish';
import { ImuView } from './view_imu';
import { LensView, RestView, WaveView } from './view_motion';
import { MountView, SheetView } from './view_sheet';
import {
  doneWords, listSteps, pictureFacts, progressWords, STEP_WORDS, summaryNow,
} from './words';
import './setup.css';

const VIEWS: Record<StepName, (context: StepContext) => StepView> = {
  camera: (context) => new CameraView(context),
  picture: (context) => new PictureView(context),
  sheet: (context) => new SheetView(context),
  lens: (context) => new LensView(context),
  imu: (context) => new ImuView(context),
  rest: () => new RestView(),
  mount: () => new MountView(),
  wave: () => new WaveView(),
  finish: (context) => new FinishView(context),
};
const WITHOUT_PICTURE: readonly StepName[] = ['imu', 'rest', 'finish'];
const REPEATED: readonly StepName[] = ['lens', 'rest', 'wave'];
// A screen reader needs time for a hint that changes with every image.
const SPEAK_MS = 4000;
const RESTARTING = 'The configuration is written. The server starts with it …';
const SILENT = 'The server does not answer. Read its messages where it was started.';
const SILENT_MS = 2000;
const LATE_MS = 30_000;

/** The set-up, over the whole page: steps, picture, questions, and one large button. */
export class SetupPanel {
  private readonly root = element('div', 'setup');
  private readonly progress = element('span');
  /** Where the list is only a row of bars. */
  private readonly progressName = element('span', 'step-now');
  private readonly list = element('ol', 'setup-steps');
  private readonly title = element('h2', 'setup-title');
  private readonly todo = element('p', 'setup-todo');
  private readonly hint = element('p', 'setup-hint');
  private readonly spoken = element('p', 'spoken');
  private readonly canvas = element('canvas');
  private readonly facts = element('p', 'setup-facts');
  private readonly figure = element('div', 'setup-picture');
  private readonly place = element('div', 'setup-controls');
  private readonly error = element('p', 'setup-error');
  private readonly why = element('p', 'setup-why');
  private readonly back = button('Back', 'To the step before', () => this.run([{ name: 'back' }]));
  private readonly again = button('Again', 'Repeat this step', () => this.doAgain());
  private readonly go = button('Next', '', () => this.press());
  private readonly link: SetupLink;
  private readonly summaries = new Map<StepName, string>();
  /** Of all steps that were reached: they keep the typed values. */
  private readonly views = new Map<StepName, StepView>();
  private view: StepView | null = null;
  private shownStep: StepName | null = null;
  private newest: SetupState | null = null;
  private bitmap: ImageBitmap | null = null;
  private running = 0;
  private last: Promise<void> = Promise.resolve();
  /** Asked for; and done. */
  private isWriting = false;
  private isWritten = false;
  private refusal = '';
  private spokenAt = 0;
  private readonly context: StepContext = {
    run: (commands) => this.run(commands),
    changed: () => this.refuse(''), // of the former input
  };

  constructor(page: string) {
    this.link = new SetupLink(page, {
      state: (state) => this.update(state),
      silent: (ms) => this.showSilence(ms),
      over: () => this.leave(),
      refused: (words) => this.refuse(words),
      picture: (picture) => this.showPicture(picture),
    });
    this.lay();
  }

  start(): void {
    this.appear();
    this.link.start();
  }

  /** This page may not lead the set-up. @param words  the remedy */
  refuseAll(words: string): void {
    this.appear();
    setText(this.title, 'This page cannot lead the set-up');
    setText(this.todo, words);
    this.list.hidden = true;
    for (const one of [this.back, this.again, this.go, this.why]) one.hidden = true;
  }

  private appear(): void {
    document.body.classList.add('sets-up');
    document.body.append(this.root);
    document.title = 'Set-up – Fiducap';
  }

  private lay(): void {
    this.canvas.setAttribute('role', 'img');
    this.title.tabIndex = -1;
    this.spoken.setAttribute('role', 'status');
    this.error.setAttribute('role', 'alert');
    this.go.classList.add('primary');
    const nav = element('nav', 'setup-side');
    nav.setAttribute('aria-label', 'Steps of the set-up');
    const progress = element('p', 'setup-progress');
    progress.append(this.progress, this.progressName);
    nav.append(element('h1', '', 'Fiducap set-up'), progress, this.list);
    this.figure.append(this.canvas, this.facts);
    const work = element('div', 'setup-work');
    work.append(this.figure, this.place);
    const main = element('main', 'setup-main');
    main.append(this.title, this.todo, this.hint, this.spoken, work);
    const bar = element('div', 'setup-bar');
    bar.setAttribute('role', 'group');
    bar.setAttribute('aria-label', 'Continue or go back');
    bar.append(this.back, this.again, this.error, this.why, this.go);
    this.root.append(nav, main, bar);
    setText(this.todo, 'Connecting to the server …');
    this.showButtons();
  }

  private update(state: SetupState): void {
    this.newest = state;
    const summary = summaryNow(state);
    if (summary !== '') this.summaries.set(state.step, summary);
    if (state.verdict?.refused) this.summaries.delete(state.step);
    this.isWritten = state.written;
    if (state.error !== '') this.isWriting = false;
    if (state.step !== this.shownStep) this.changeStep(state);
    const hasPicture = !WITHOUT_PICTURE.includes(state.step) && state.camera !== null;
    this.figure.hidden = !hasPicture;
    this.link.requestPictures(hasPicture);
    this.again.hidden = !REPEATED.includes(state.step) || state.verdict?.refused === true;
    this.showSteps(state);
    this.view?.update(state);
    const hint = state.written ? RESTARTING : (this.view?.hint(state) ?? '');
    setText(this.hint, hint);
    this.hint.hidden = hint === '';
    this.hint.dataset.tone = this.tone(state);
    this.speak(hint);
    setText(this.facts, pictureFacts(state));
    this.draw();
    this.showButtons();
  }

  private tone(state: SetupState): string {
    if (state.written) return '';
    if (this.view?.tone) return this.view.tone(state);
    return state.verdict ? judge(state.verdict).tone : '';
  }

  private changeStep(state: SetupState): void {
    const isFirst = this.shownStep === null;
    this.shownStep = state.step;
    this.view = this.views.get(state.step) ?? VIEWS[state.step](this.context);
    this.views.set(state.step, this.view);
    this.place.replaceChildren(this.view.root);
    this.root.dataset.step = state.step;
    const { title, todo } = STEP_WORDS[state.step];
    setText(this.title, title);
    setText(this.todo, todo);
    this.back.hidden = state.step === state.steps[0]?.name;
    // The start for screen readers and keyboards: the buttons before it may be gone.
    if (!isFirst) this.title.focus();
    window.scrollTo(0, 0);
  }

  private showSteps(state: SetupState): void {
    const steps = listSteps(state);
    setText(this.progress, progressWords(state));
    setText(this.progressName, ` · ${STEP_WORDS[state.step].short}`);
    if (this.list.childElementCount !== steps.length)
      this.list.replaceChildren(...steps.map(() => stepItem()));
    steps.forEach(({ name, mark }, i) => {
      const item = this.list.children[i] as HTMLElement;
      item.dataset.mark = mark;
      if (mark === 'current') item.setAttribute('aria-current', 'step');
      else item.removeAttribute('aria-current');
      const done = mark === 'done' ? this.doneWords(state, name) : '';
      const note = mark === 'left out' ? 'only with an IMU' : mark === 'skipped' ? 'skipped' : done;
      const words = [MARK_WORD[mark], STEP_WORDS[name].short, note];
      words.forEach((word, part) => setText(item.children[part] as Element, word));
    });
  }

  private doneWords(state: SetupState, name: StepName): string {
    return doneWords(state, name, this.summaries.get(name) ?? '') || 'done';
  }

  private showButtons(): void {
    const primary = this.primary();
    const isOff = this.running > 0 || this.newest?.solving === true;
    setText(this.go, primary.words);
    this.go.dataset.ready = String(primary.ready);
    this.go.disabled = isOff || primary.blocked !== '';
    this.go.title = primary.blocked;
    this.back.disabled = this.again.disabled = isOff || this.isWritten;
    const error = this.refusal || this.newest?.error || '';
    setText(this.error, error);
    setText(this.why, error === '' ? primary.blocked : '');
  }

  private primary(): Primary {
    if (this.newest && this.view) return ifComplete(this.view.primary(this.newest), this.newest);
    return { words: 'Next', ready: false, blocked: 'Waiting for the server.', commands: () => [] };
  }

  private press(): void {
    const commands = this.primary().commands();
    if (typeof commands === 'string') return this.refuse(commands);
    this.isWriting = commands.some((one) => one.name === 'write');
    this.run(commands);
  }

  private doAgain(): void {
    if (this.newest) this.summaries.delete(this.newest.step);
    this.run([AGAIN]);
  }

  private run(commands: SetupCommand[]): void {
    // In order: buttons pressed during a request are handled after it.
    this.running += 1;
    this.showButtons();
    this.last = this.last.then(async () => {
      await this.link.run(commands);
      this.running -= 1;
      this.showButtons();
    });
  }

  private refuse(words: string): void {
    this.refusal = words;
    if (words !== '') this.isWriting = false;
    this.showButtons();
  }

  /** Drawn with the state that comes with it. */
  private showPicture(bitmap: ImageBitmap): void {
    this.bitmap?.close();
    this.bitmap = bitmap;
  }

  private draw(): void {
    if (this.figure.hidden) return;
    const state = this.newest;
    // Another camera was chosen, or none: what it showed is over.
    const bitmap = state?.picture ? this.bitmap : null;
    const lens = state?.step === 'lens' ? state.lens : null;
    const drawn = { bitmap, picture: state?.picture ?? null, lens };
    drawPicture(this.canvas, drawn);
    const words = pictureWords(drawn);
    if (this.canvas.getAttribute('aria-label') !== words)
      this.canvas.setAttribute('aria-label', words);
  }

  private speak(hint: string): void {
    const now = performance.now();
    if (now - this.spokenAt < SPEAK_MS || hint === this.spoken.textContent) return;
    this.spokenAt = now;
    setText(this.spoken, hint);
  }

  private showSilence(ms: number): void {
    const isStarting = this.isWritten || this.isWriting;
    if (!isStarting && ms < SILENT_MS) return;
    const words = isStarting && ms < LATE_MS ? RESTARTING : SILENT;
    setText(this.hint, words);
    this.hint.hidden = false;
    this.speak(words);
  }

  /** The page of a server that runs is another one. */
  private leave(): void {
    this.link.stop();
    const isFinished = this.isWritten || this.isWriting;
    if (this.newest && isFinished) remember({ file: this.newest.file, at: 0 });
    location.reload();
  }
}

const MARK_WORD = { done: '✓', current: '●', open: '○', 'left out': '–', skipped: '–' } as const;

function stepItem(): HTMLLIElement {
  const item = element('li');
  const mark = element('span', 'step-mark');
  mark.setAttribute('aria-hidden', 'true');
  item.append(mark, element('span', 'step-name'), element('span', 'step-note'));
  return item;
}
