import { exaggeration } from './changes_view';
import { element, setText } from './dom';
import { compact, count, dateAndTime, duration, fixed, UNKNOWN } from './format';
import { button, type MapCommands } from './map_commands';
import { parseDiff, parseVersions, type MapDiff, type MapTag, type MapVersion, type TagChange, type TagFit, type TagMap } from './protocol';
import { reader } from './reader';

// The server reads versions from its disk on request; then the request is repeated.
const ASK_AGAIN_MS = 300;
const ASK_AT_MOST = 20;
const LOOK_MS = 1000;
const NOW_MS = 2500; // the server reports sightings once a second
const DAY_MS = 86_400_000;
const CHOOSE = 'Choose a version to see what has changed since.';
const ARROWS = 'How far it moved. Its arrow in the room is at least 10 cm long.';
const FIT =
  'How far the tag’s corners were from where the bodies’ filters have them after the image, RMS over about 50 sightings, pixels. ' +
  'Rejected sightings count, too. Much more than the others: look at this tag.';

export interface Listener {
  /** The versions that are compared; null: none. */
  compared(diff: MapDiff | null): void;
  /** A tag of the list; null: none any more. */
  chosen(tag: number | null): void;
}

/** Stored versions of the map, how two of them differ, and every tag of the one that is served. */
export class MapPanel {
  private readonly versions = table('versions', [['Version'], ['Stored'], ['Tags'], ['Name']]);
  private readonly changes = table('changes', [['Tag'], ['Change'], ['mm', ARROWS], ['°']]);
  private readonly tags = table('tags', [
    ['Tag'],
    ['State'],
    ['1σ mm', 'Uncertainty of its place, the worst of x, y and z'],
    ['Fit px', FIT],
    ['Seen', 'Sightings used for its place'],
    ['Last', 'When a body saw it last'],
  ]);
  private readonly message = element('p', 'empty');
  private readonly versionDeeds: HTMLTableRowElement;
  private readonly tagDeeds: HTMLTableRowElement;
  private readonly rows = new Map<number, HTMLTableRowElement>();
  private readonly fits = new Map<number, TagFit>();
  private map: TagMap | null = null;
  private listed = '';
  private shown: MapVersion[] = [];
  private compared: number | null = null;
  private tag: number | null = null;
  private asking = 0;
  private serverNow = 0;

  constructor(
    private readonly host: HTMLElement,
    commands: MapCommands,
    private readonly listener: Listener,
  ) {
    this.changes.hidden = true;
    this.versionDeeds = deeds(4, commands.gated(
      button('Name…', 'Keep this version under a name', () => this.withVersion((one) => commands.name(one))),
      button('Roll back…', 'Serve this version again', () => this.withVersion((one) => commands.rollBack(one, this.newest()))),
    ));
    this.tagDeeds = deeds(6, commands.gated(
      button('Quarantine…', 'Keep the tag, do not use it', () => this.tag !== null && void commands.quarantine(this.tag)),
      button('Forget…', 'Discard the tag; seen again, it is a new one', () => this.tag !== null && void commands.forget(this.tag)),
    ));
    host.append(commands.head, list('past', this.versions, this.message, this.changes), list('tags-list', this.tags));
    setInterval(() => void this.refresh(), LOOK_MS);
  }

  /** Of the map that is served. */
  update(map: TagMap): void {
    this.map = map;
    this.layTags();
  }

  /** Of the tags that were seen a moment ago, or of all. */
  updateFits(fits: TagFit[]): void {
    for (const fit of fits) this.fits.set(fit.id, fit);
    this.showTags();
  }

  /** Another server: the sightings of the one before are void. */
  restart(): void {
    this.fits.clear();
  }

  /** @param utcMs  the server's clock, the reference of ages */
  setTime(utcMs: number): void {
    this.serverNow = utcMs;
  }

  /** A tag that was selected, here or in the room; again: deselected. */
  choose(tag: number | null): void {
    this.tag = tag === this.tag ? null : tag;
    this.layTags();
    if (this.tag !== null) this.rows.get(this.tag)?.scrollIntoView({ block: 'center' });
    this.listener.chosen(this.tag);
  }

  /** While it is visible: ages grow, and any operator may have named a version. */
  async refresh(): Promise<void> {
    this.showTags();
    if (this.host.hidden || document.hidden) return;
    const answer = await reader.fetch(new URL('api/v1/map/versions', document.baseURI)).catch(() => null);
    if (!answer?.ok) return; // the link reports it
    const text = await answer.text();
    if (text === this.listed) return;
    this.listed = text;
    this.shown = parseVersions(text);
    bodyOf(this.versions).replaceChildren(...this.shown.map((version) => this.versionRow(version)));
    this.press();
    this.versions.hidden = this.shown.length === 0;
    if (this.shown.length === 0) this.say('The map has no store, or nothing is in it yet.');
    else if (this.compared === null) this.say(CHOOSE);
  }

  private versionRow(version: MapVersion): HTMLTableRowElement {
    const row = element('tr');
    row.dataset.version = String(version.version);
    const number = button(String(version.version), 'What has changed since this version', () => void this.compare(version.version));
    const stored = element('td', '', dateAndTime(version.utcMs));
    row.append(heading(number), stored, element('td', 'number', count(version.tags)), element('td', 'name', version.comment));
    return row;
  }

  /** Compares with the newest one; again: ends it. */
  private async compare(version: number): Promise<void> {
    const turn = ++this.asking;
    const newest = this.newest();
    this.compared = this.compared === version ? null : version;
    this.press();
    if (this.compared === null) return this.show(null);
    for (let i = 0; i < ASK_AT_MOST; ++i) {
      const answer = await reader.fetch(new URL(`api/v1/map/diff/${version}/${newest}`, document.baseURI));
      if (turn !== this.asking) return;
      if (answer.ok) return this.show(parseDiff(await answer.text()));
      if (answer.status !== 503) return this.say(await answer.text());
      await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
    }
    this.say('The server cannot read these versions from its disk.');
  }

  private show(diff: MapDiff | null): void {
    this.say(diff ? diffWords(diff) : CHOOSE);
    this.changes.hidden = diff === null || diff.changes.length === 0;
    bodyOf(this.changes).replaceChildren(...(diff?.changes ?? []).map(changeRow));
    this.listener.compared(diff);
  }

  private press(): void {
    this.versionDeeds.remove();
    for (const row of bodyOf(this.versions).rows) {
      const isChosen = row.dataset.version === String(this.compared);
      row.querySelector('button')?.setAttribute('aria-pressed', String(isChosen));
      if (isChosen) row.after(this.versionDeeds);
    }
  }

  /** A row for each tag. Rows are kept, so that none moves while it is tapped. */
  private layTags(): void {
    const tags = this.map?.tags ?? [];
    const ids = new Set(tags.map((tag) => tag.id));
    for (const id of this.rows.keys()) if (!ids.has(id)) this.rows.delete(id);
    if (this.tag !== null && !ids.has(this.tag)) this.tag = null;
    for (const { id } of tags) if (!this.rows.has(id)) this.rows.set(id, this.tagRow(id));
    const wanted = tags.flatMap(({ id }) => [this.rows.get(id), id === this.tag ? this.tagDeeds : undefined]);
    const list = wanted.filter((row): row is HTMLTableRowElement => row !== undefined);
    const body = bodyOf(this.tags);
    if (list.length !== body.rows.length || list.some((row, i) => row !== body.rows[i])) body.replaceChildren(...list);
    for (const [id, row] of this.rows) row.querySelector('button')?.setAttribute('aria-pressed', String(id === this.tag));
    this.showTags();
  }

  private tagRow(id: number): HTMLTableRowElement {
    const row = element('tr');
    row.dataset.tag = String(id);
    row.append(heading(button(String(id), 'Show this tag in the room', () => this.choose(id))));
    for (const kind of ['', 'number', 'number', 'number', 'number']) row.append(element('td', kind));
    return row;
  }

  private showTags(): void {
    if (this.host.hidden) return;
    const odd = oddFit([...this.fits.values()].map((fit) => fit.px));
    for (const tag of this.map?.tags ?? []) {
      const row = this.rows.get(tag.id);
      if (!row) continue;
      const cells = tagCells(tag, this.fits.get(tag.id) ?? null, this.serverNow);
      cells.forEach((words, i) => setText(row.cells[i + 1] as Element, words));
      (row.cells[1] as Element).className = tag.state;
      row.cells[3]?.classList.toggle('odd', (this.fits.get(tag.id)?.px ?? 0) > odd);
    }
  }

  private withVersion(act: (version: MapVersion) => Promise<void>): void {
    const chosen = this.shown.find((one) => one.version === this.compared);
    if (chosen) void act(chosen);
  }

  private newest(): number {
    return this.shown[0]?.version ?? 0;
  }

  private say(words: string): void {
    setText(this.message, words);
  }
}

/** `Version 11 → 12: 2 tags differ. Arrows in the room are 100 times as long, at least 10 cm.` */
export function diffWords(diff: MapDiff): string {
  const number = diff.changes.length;
  const what = number === 0 ? 'no tag differs' : number === 1 ? '1 tag differs' : `${number} tags differ`;
  const factor = exaggeration(diff.changes);
  const drawn = factor > 1 ? `. Arrows in the room are ${factor} times as long, at least 10 cm.` : '';
  return `Version ${diff.before} → ${diff.after}: ${what}${drawn}`;
}

/** Above this a tag fits worse than its neighbours explain: three times what half of the tags stay below, and a pixel. */
export function oddFit(fits: (number | null)[]): number {
  const known = fits.filter((px): px is number => px !== null).sort((a, b) => a - b);
  return Math.max(1, 3 * (known[known.length >> 1] ?? 0));
}

/** State, 1σ, fit, sightings and age as they are written. */
export function tagCells(tag: MapTag, fit: TagFit | null, nowMs: number): string[] {
  const seenAt = Math.max(tag.lastSeenUtcMs ?? 0, fit?.lastSeenUtcMs ?? 0);
  const age = seenAt > 0 && nowMs > 0 ? nowMs - seenAt : null;
  return [tag.state, compact(tag.sigmaMm, 2), fixed(fit?.px ?? null, 2), count(tag.sightings), ageWords(age)];
}

/** `now`, `4 s ago`, `2.0 h ago`, `3 d ago` */
function ageWords(ms: number | null): string {
  if (ms !== null && ms < NOW_MS) return 'now';
  if (ms !== null && ms > 2 * DAY_MS) return `${fixed(ms / DAY_MS, 0)} d ago`;
  const { value, unit } = duration(ms);
  return unit ? `${value} ${unit} ago` : value;
}

function changeRow(change: TagChange): HTMLTableRowElement {
  const row = element('tr', change.kind);
  const moved = change.kind === 'moved';
  row.append(
    element('td', 'number', String(change.id)),
    element('td', '', change.kind),
    element('td', 'number', moved ? compact(change.mm, 3) : UNKNOWN),
    element('td', 'number', moved ? fixed(change.deg, 3) : UNKNOWN),
  );
  return row;
}

function heading(content: HTMLElement): HTMLTableCellElement {
  const head = element('th');
  head.scope = 'row';
  head.append(content);
  return head;
}

/** Each scrolls alone: many versions leave the tags their place. */
function list(name: string, ...content: HTMLElement[]): HTMLElement {
  const made = element('div', `scroll ${name}`);
  made.tabIndex = 0;
  made.append(...content);
  return made;
}

function deeds(columns: number, content: HTMLElement): HTMLTableRowElement {
  const row = element('tr', 'deeds-row');
  const cell = element('td');
  cell.colSpan = columns;
  cell.append(content);
  row.append(cell);
  return row;
}

/** @param headings  each with a tooltip, where needed */
function table(name: string, headings: [string, string?][]): HTMLTableElement {
  const made = element('table', name);
  const row = element('tr');
  for (const [words, meaning] of headings) {
    const cell = element('th', '', words);
    cell.scope = 'col';
    if (meaning) cell.title = meaning;
    row.append(cell);
  }
  const head = element('thead');
  head.append(row);
  made.append(head, element('tbody'));
  return made;
}

function bodyOf(host: HTMLTableElement): HTMLTableSectionElement {
  return host.tBodies[0] as HTMLTableSectionElement;
}
