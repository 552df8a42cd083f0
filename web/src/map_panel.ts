import { element } from './dom';
import { compact, count, duration, fixed, timeOfDay, UNKNOWN } from './format';
import { parseDiff, parseVersions, type MapDiff, type MapTag, type MapVersion, type TagChange, type TagMap } from './protocol';

// The server reads versions from its disk when somebody asks; then it is asked again.
const ASK_AGAIN_MS = 300;
const ASK_AT_MOST = 20;

/** Stored versions of the map, how two of them differ, and every tag of the one that is served. */
export class MapPanel {
  private readonly versions = table('versions', ['Version', 'Stored', 'Tags', 'Name']);
  private readonly changes = table('changes', ['Tag', 'Change', 'mm', '°']);
  private readonly tags = table('tags', ['Tag', 'State', '1σ mm', 'Seen', 'Last']);
  private readonly message = element('p', 'empty');
  private shown: MapVersion[] = [];
  private compared: number | null = null;
  private asking = 0;

  /** @param compared  told what is compared now; null: nothing */
  constructor(
    private readonly host: HTMLElement,
    private readonly onCompared: (diff: MapDiff | null) => void,
  ) {
    this.changes.hidden = true;
    host.append(this.versions, this.message, this.changes, this.tags);
  }

  /** Of the map that is served. Reads the list when it is looked at. */
  update(map: TagMap): void {
    const now = Date.now();
    bodyOf(this.tags).replaceChildren(...map.tags.map((tag) => tagRow(tag, now)));
    void this.refresh();
  }

  async refresh(): Promise<void> {
    if (this.host.hidden) return;
    const answer = await fetch(new URL('api/v1/map/versions', document.baseURI));
    if (!answer.ok) return this.say('The list of versions cannot be had just now.');
    this.shown = parseVersions(await answer.text());
    bodyOf(this.versions).replaceChildren(...this.shown.map((version) => this.versionRow(version)));
    this.versions.hidden = this.shown.length === 0;
    if (this.shown.length === 0) this.say('The map has no store, or nothing is in it yet.');
    else if (this.compared === null) this.say('Choose a version to see what has changed since.');
  }

  private versionRow(version: MapVersion): HTMLTableRowElement {
    const row = element('tr');
    const button = element('button', '', String(version.version));
    button.type = 'button';
    button.title = 'What has changed since this version';
    button.setAttribute('aria-pressed', String(version.version === this.compared));
    button.addEventListener('click', () => void this.compare(version.version));
    const head = element('th');
    head.scope = 'row';
    head.append(button);
    const stored = element('td', '', dateAndTime(version.utcMs));
    row.append(head, stored, element('td', 'number', count(version.tags)), element('td', 'name', version.comment));
    return row;
  }

  /** With the newest one; again: no more. */
  private async compare(version: number): Promise<void> {
    const turn = ++this.asking;
    const newest = this.shown[0]?.version;
    this.compared = this.compared === version || newest === undefined ? null : version;
    this.press();
    if (this.compared === null || newest === undefined) return this.show(null);
    for (let i = 0; i < ASK_AT_MOST; ++i) {
      const answer = await fetch(new URL(`api/v1/map/diff/${version}/${newest}`, document.baseURI));
      if (turn !== this.asking) return;
      if (answer.ok) return this.show(parseDiff(await answer.text()));
      if (answer.status !== 503) return this.say(await answer.text());
      await new Promise((resolve) => setTimeout(resolve, ASK_AGAIN_MS));
    }
    this.say('The server does not get these versions from its disk.');
  }

  private show(diff: MapDiff | null): void {
    this.say(diff ? diffWords(diff) : 'Choose a version to see what has changed since.');
    this.changes.hidden = diff === null || diff.changes.length === 0;
    bodyOf(this.changes).replaceChildren(...(diff?.changes ?? []).map(changeRow));
    this.onCompared(diff);
  }

  private press(): void {
    for (const button of this.versions.querySelectorAll('button')) {
      button.setAttribute('aria-pressed', String(button.textContent === String(this.compared)));
    }
  }

  private say(words: string): void {
    this.message.textContent = words;
  }
}

/** `Version 11 → 12: 2 tags differ` */
export function diffWords(diff: MapDiff): string {
  const number = diff.changes.length;
  const what = number === 0 ? 'no tag differs' : number === 1 ? '1 tag differs' : `${number} tags differ`;
  return `Version ${diff.before} → ${diff.after}: ${what}`;
}

/** `2026-09-21 14:13:20` */
function dateAndTime(utcMs: number): string {
  return `${new Date(utcMs).toLocaleDateString('en-CA')} ${timeOfDay(utcMs)}`;
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

function tagRow(tag: MapTag, nowMs: number): HTMLTableRowElement {
  const row = element('tr');
  row.dataset.tag = String(tag.id);
  const { value, unit } = duration(tag.lastSeenUtcMs === null ? null : Math.max(0, nowMs - tag.lastSeenUtcMs));
  row.append(
    element('td', 'number', String(tag.id)),
    element('td', tag.state, tag.state),
    element('td', 'number', compact(tag.sigmaMm, 2)),
    element('td', 'number', count(tag.sightings)),
    element('td', 'number', unit ? `${value} ${unit} ago` : value),
  );
  return row;
}

function table(name: string, headings: string[]): HTMLTableElement {
  const made = element('table', name);
  const row = element('tr');
  for (const heading of headings) {
    const cell = element('th', '', heading);
    cell.scope = 'col';
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
