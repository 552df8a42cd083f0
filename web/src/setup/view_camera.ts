// The first two steps: which camera, and whether its picture is good.
import { element, setText } from '../dom';
import { fixed } from '../format';
import { button } from '../map_commands';
import { drawHistogram } from '../view_canvas';
import { column, labelled, next, numberInput, textInput, type StepContext, type Primary } from './parts';
import type { StepView, Tone } from './parts';
import type { CameraFound, SetupState } from './protocol';
import { plainNumber, typedNumber } from './words';

const OTHER_EXAMPLE = 'rtsp://192.168.1.7/live, or v4l2src ! videoconvert ! appsink';

export class CameraView implements StepView {
  readonly root: HTMLElement;
  private readonly found = element('div', 'choices');
  private readonly empty = element('p', 'empty');
  private readonly open = textInput('', OTHER_EXAMPLE);
  private readonly width = numberInput('');
  private readonly height = numberInput('');
  private readonly rate = numberInput('');
  private readonly fault = element('p', 'fault');
  private shown = '';

  constructor(private readonly context: StepContext) {
    this.found.setAttribute('role', 'group');
    this.found.setAttribute('aria-label', 'Cameras');
    setText(this.empty, 'No camera is found. Plug one in, then look again.');
    this.fault.setAttribute('role', 'alert');
    const look = button('Look again', 'List the cameras again', () => context.run([{ name: 'look' }]));
    this.root = column(this.found, this.empty, look, this.other());
  }

  hint(state: SetupState): string {
    if (!state.camera) return ''; // the title is enough
    return state.picture ? 'Is this the picture of the robot’s camera?' : 'Opening the camera …';
  }

  update(state: SetupState): void {
    const key = JSON.stringify([state.cameras, state.camera?.open]);
    if (key === this.shown) return;
    this.shown = key;
    const focused = this.found.contains(document.activeElement)
      ? (document.activeElement as HTMLElement).dataset.open
      : undefined;
    const rows = state.cameras.map((one) => this.row(one, one.open === state.camera?.open));
    this.found.replaceChildren(...rows);
    rows.find((row) => row.dataset.open === focused)?.focus();
    this.empty.hidden = state.cameras.length > 0;
  }

  primary({ camera, picture }: SetupState): Primary {
    if (!camera) return next('Next', false, 'Choose a camera first.');
    return picture ? next() : next('Next', false, 'No picture has come yet.');
  }

  private row(camera: CameraFound, isChosen: boolean): HTMLButtonElement {
    const choose = (): void => this.context.run([{ name: 'camera', values: { open: camera.open } }]);
    const made = button('', `Use ${camera.open}`, choose);
    made.className = 'choice';
    made.dataset.open = camera.open;
    made.setAttribute('aria-pressed', String(isChosen));
    made.append(element('span', 'choice-name', camera.name));
    const detail = isChosen ? `${camera.open} · chosen` : camera.open;
    made.append(element('span', 'choice-detail', detail));
    if (camera.problem) made.append(element('span', 'choice-problem', camera.problem));
    return made;
  }

  private other(): HTMLElement {
    const size = element('div', 'field-row');
    size.append(
      labelled('Width', this.width),
      labelled('Height', this.height),
      labelled('Images/s', this.rate),
    );
    const use = button('Use this', 'Open this source', () => this.useOther());
    const made = element('details', 'other');
    made.append(
      element('summary', '', 'Another source, or another size'),
      labelled('Device, address or pipeline', this.open),
      size,
      element('p', 'field-why', 'Empty: the default of the camera.'),
      this.fault,
      use,
    );
    return made;
  }

  private useOther(): void {
    const values: Record<string, string> = { open: this.open.value.trim() };
    const numbers: [string, string, HTMLInputElement][] = [
      ['width', 'Width', this.width],
      ['height', 'Height', this.height],
      ['rate_hz', 'Images/s', this.rate],
    ];
    let fault = values.open === '' ? 'Enter the source, for example /dev/video0.' : '';
    for (const [key, words, input] of numbers) {
      if (input.value.trim() === '') continue;
      const value = typedNumber(input.value);
      if (value === null || value <= 0)
        fault ||= `${words}: “${input.value}” is no number above 0.`;
      values[key] = String(value);
    }
    setText(this.fault, fault);
    if (fault === '') this.context.run([{ name: 'camera', values }]);
  }
}

export class PictureView implements StepView {
  readonly root: HTMLElement;
  private readonly exposure = numberInput('');
  private readonly setter = element('form', 'field-row exposure');
  private readonly fixedExposure = element('p', 'field-why');
  private readonly fault = element('p', 'fault');
  private readonly measures = element('dl', 'facts-list');
  private readonly histogram = element('canvas', 'histogram');

  constructor(private readonly context: StepContext) {
    this.fault.setAttribute('role', 'alert');
    this.histogram.width = 256;
    this.histogram.height = 64;
    this.histogram.setAttribute('role', 'img');
    setText(this.fixedExposure, 'This camera sets its exposure by itself.');
    const set = element('button', '', 'Set');
    const shorter = button('Shorter', 'Half as long', () => this.send(this.scaled(0.5)));
    const longer = button('Longer', 'Twice as long', () => this.send(this.scaled(2)));
    this.setter.append(labelled('Exposure, ms', this.exposure), set, shorter, longer);
    this.setter.addEventListener('submit', (event) => {
      event.preventDefault();
      this.send(typedNumber(this.exposure.value));
    });
    this.root = column(
      this.setter, this.fixedExposure, this.fault, this.histogram, this.measures,
    );
  }

  hint({ picture }: SetupState): string {
    return picture?.verdict ?? '';
  }

  tone({ picture }: SetupState): Tone {
    return picture?.good ? 'good' : 'warn';
  }

  update({ camera, picture }: SetupState): void {
    const exposure = camera?.exposureMs ?? null;
    this.setter.hidden = exposure === null;
    this.fixedExposure.hidden = exposure !== null;
    if (exposure !== null && document.activeElement !== this.exposure)
      this.exposure.value = plainNumber(exposure);
    if (!picture) return;
    drawHistogram(this.histogram, picture.histogram);
    const bright = `${fixed(100 * picture.brightShare, 0)} %`;
    const dark = `${fixed(100 * picture.darkShare, 0)} %`;
    this.histogram.setAttribute('aria-label', `Histogram: ${bright} too bright, ${dark} too dark`);
    const pixels = (px: number | null): string =>
      px === null ? 'no tag seen' : `${fixed(px, 1)} px`;
    this.showMeasures([
      ['Blur of edges', pixels(picture.focusPx)],
      ['Smeared by motion', pixels(picture.motionPx)],
      ['Too bright', bright],
      ['Too dark', dark],
    ]);
  }

  primary({ picture }: SetupState): Primary {
    if (!picture) return next('Next', false, 'No picture has come yet.');
    return picture.good ? next() : next('Continue with this picture', false);
  }

  private showMeasures(rows: [string, string][]): void {
    if (this.measures.childElementCount === 0)
      for (const [words] of rows) this.measures.append(element('dt', '', words), element('dd'));
    const values = this.measures.querySelectorAll('dd');
    rows.forEach(([, value], i) => setText(values[i] as Element, value));
  }

  private scaled(factor: number): number | null {
    const now = typedNumber(this.exposure.value);
    return now === null ? null : Math.round(1000 * factor * now) / 1000;
  }

  private send(ms: number | null): void {
    const isTime = ms !== null && ms > 0;
    setText(this.fault, isTime ? '' : `“${this.exposure.value}” is no time above 0 ms.`);
    if (!isTime) return;
    this.exposure.value = plainNumber(ms);
    this.exposure.blur();
    this.context.run([{ name: 'settings', values: { exposure_ms: plainNumber(ms) } }]);
  }
}
