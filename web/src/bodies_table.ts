import { element, setText } from './dom';
import { compact, count, duration, fixed, latency, length, UNKNOWN, type Quantity } from './format';
import type { BodyFrame, BodyName, Quaternion } from './protocol';
import type { ShownBody } from './steady';
import { bodyColour, STATE_WORD } from './theme';

interface Column {
  name: string;
  title: string;
  /** Of the 48 grid columns that both rows share. */
  span: number;
  /** Beside the heading instead of beside every value. */
  fixedUnit?: string;
  read(body: BodyFrame): Quantity;
  /** Tooltip of the value. */
  hint?(body: BodyFrame): string;
}

const GRID_COLUMNS = 48;

const axis = (name: string, i: 0 | 1 | 2, span: number): Column => ({
  name,
  title: `Position ${name}, axes of the room`,
  span,
  fixedUnit: 'm',
  read: (body) => ({ value: fixed(body.pose?.p[i] ?? null, 3), unit: '' }),
});

const angle = (name: string, i: 0 | 1 | 2, title: string): Column => ({
  name,
  title,
  span: 12,
  read: (body) => ({ value: fixed(body.pose ? yawPitchRoll(body.pose.q)[i] : null, 1), unit: '°' }),
});

// Three rows per body: the place in large figures, attitude and speed, their quality.
const PLACE: Column[] = [axis('x', 0, 16), axis('y', 1, 16), axis('z', 2, 16)];
const ATTITUDE: Column[] = [
  angle('yaw', 0, 'Heading of the body, about the room’s z'),
  angle('pitch', 1, 'Nose down is positive'),
  angle('roll', 2, 'Leaning to the right is positive'),
  {
    name: 'speed',
    title: 'Speed of the body',
    span: 12,
    fixedUnit: 'm/s',
    read: (body) => ({ value: fixed(body.pose?.speed ?? null, 2), unit: '' }),
  },
];

const QUALITY_SPAN = 8;
const QUALITY: Column[] = [
  {
    name: '1σ pos',
    title: 'Position 1-sigma, worst axis',
    span: QUALITY_SPAN,
    read: (body) => length(body.pose?.sigmaMm ?? null),
  },
  {
    name: '1σ rot',
    title: 'Attitude 1-sigma, worst axis',
    span: QUALITY_SPAN,
    read: (body) => ({ value: compact(body.pose?.sigmaDeg ?? null, 2), unit: '°' }),
  },
  {
    name: 'tags',
    title: 'Tags used in the newest image',
    span: QUALITY_SPAN,
    read: (body) => ({ value: String(body.tags), unit: '' }),
    hint: (body) => `reprojection ${fixed(body.reprojectionPx, 2)} px`,
  },
  {
    name: 'age',
    title: 'Since the last image with a used tag',
    span: QUALITY_SPAN,
    read: (body) => duration(body.pose?.ageMs ?? null),
  },
  {
    name: 'latency',
    title: 'Arrival of the newest image to its update done',
    span: QUALITY_SPAN,
    read: (body) => latency(body.latencyMs),
  },
  {
    name: 'images',
    title: 'Images per second',
    span: QUALITY_SPAN,
    read: (body) => ({ value: compact(body.imageRateHz, 1), unit: 'Hz' }),
    hint: (body) => `${count(body.imagesDropped)} images dropped`,
  },
];

interface Cell {
  column: Column;
  value: HTMLElement;
  unit: HTMLElement;
}

interface Card {
  root: HTMLElement;
  state: HTMLElement;
  age: HTMLElement;
  note: HTMLElement;
  name: HTMLButtonElement;
  cells: Cell[];
}

/** One card per body: a table with its name as caption. Choosing a card chooses the body in the room as well. */
export class BodiesTable {
  private readonly cards = new Map<number, Card>();
  private chosen: number | null = null;

  constructor(
    private readonly host: HTMLElement,
    private readonly onChoose: (id: number) => void,
  ) {}

  setBodies(bodies: BodyName[]): void {
    this.cards.clear();
    this.host.replaceChildren();
    bodies.forEach((body, place) => {
      const card = this.makeCard(body, place);
      this.cards.set(body.id, card);
      this.host.append(card.root);
    });
    this.host.classList.toggle('many', bodies.length > 4);
    if (bodies.length === 0) this.host.append(element('p', 'empty', 'The configuration names no bodies.'));
    this.choose(this.chosen);
  }

  choose(id: number | null): void {
    this.chosen = id;
    for (const [cardId, card] of this.cards) {
      card.root.classList.toggle('chosen', cardId === id);
      card.name.setAttribute('aria-pressed', String(cardId === id));
    }
  }

  update(bodies: ShownBody[]): void {
    for (const body of bodies) {
      const card = this.cards.get(body.id);
      if (!card) continue;
      card.root.dataset.state = body.state;
      card.root.dataset.valid = String(body.valid);
      setText(card.state, STATE_WORD[body.state]);
      setText(card.age, ageWords(body.stateAgeMs));
      setText(card.note, noteFor(body));
      for (const cell of card.cells) {
        const { value, unit } = cell.column.read(body);
        setText(cell.value, value);
        setText(cell.unit, value === UNKNOWN ? '' : unit);
        const hint = cell.column.hint?.(body);
        if (hint && cell.value.title !== hint) cell.value.title = hint;
      }
    }
  }

  private makeCard(body: BodyName, place: number): Card {
    const root = element('article', 'card');
    root.dataset.body = String(body.id);
    root.style.setProperty('--body', bodyColour(place));
    const table = element('table');
    const caption = element('caption');
    const title = element('div', 'title');
    const name = element('button', 'name', body.name);
    name.type = 'button';
    name.title = 'Choose this body in the room';
    name.addEventListener('click', () => this.onChoose(body.id));
    const note = element('span', 'note');
    const state = element('span', 'state');
    const age = element('span', 'state-age');
    title.append(name, note, state, age);
    caption.append(title);
    const columns = element('colgroup');
    for (let i = 0; i < GRID_COLUMNS; ++i) columns.append(element('col'));
    table.append(caption, columns);
    const rows = [[PLACE, 'place'], [ATTITUDE, 'quality'], [QUALITY, 'quality']] as const;
    const cells = rows.flatMap(([columns, kind]) => addRows(table, body.id, columns, kind));
    root.append(table);
    return { root, state, age, note, name, cells };
  }
}

/** Heading, then pitch, then roll (z-y'-x''), degrees. */
export function yawPitchRoll([w, x, y, z]: Quaternion): [number, number, number] {
  const degrees = 180 / Math.PI;
  return [
    degrees * Math.atan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z)),
    degrees * Math.asin(Math.min(1, Math.max(-1, 2 * (w * y - x * z)))),
    degrees * Math.atan2(2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
  ];
}

/** Whole units: `0 s`, `12 s`, `3 min`. */
function ageWords(ms: number | null): string {
  if (ms === null) return '';
  const units: [number, string][] = [[3_600_000, 'h'], [60_000, 'min'], [1000, 's']];
  const [size, unit] = units.find(([least]) => ms >= least) ?? [1000, 's'];
  return `${Math.floor(ms / size)} ${unit}`;
}

/** Conditions that the number cells do not show. */
function noteFor(body: BodyFrame): string {
  if (!body.pose) return 'no pose';
  if (!body.valid) return 'last known';
  return '';
}

/** A row of headings and the row of values below it. */
function addRows(table: HTMLTableElement, bodyId: number, columns: Column[], kind: string): Cell[] {
  const group = element('tbody', kind);
  const heads = element('tr', 'heads');
  const values = element('tr');
  const cells = columns.map((column) => {
    const head = element('th', '', column.name);
    head.id = `body-${bodyId}-${column.name.replace(/\W/g, '-')}`;
    head.scope = 'col';
    head.title = column.title;
    head.colSpan = column.span;
    if (column.fixedUnit) head.append(element('span', 'unit', column.fixedUnit));
    const cell = element('td');
    cell.headers = head.id;
    cell.colSpan = head.colSpan;
    const value = element('span', 'value', UNKNOWN);
    const unit = element('span', 'unit');
    cell.append(value, unit);
    heads.append(head);
    values.append(cell);
    return { column, value, unit };
  });
  group.append(heads, values);
  table.append(group);
  return cells;
}
