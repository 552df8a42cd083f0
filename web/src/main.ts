import { BodiesTable } from './bodies_table';
import type { CamerasPanel } from './cameras_panel';
import { StripChart, type ChartQuantity } from './chart';
import { ClientsPanel } from './clients_panel';
import { Connection, liveUrl, type LinkState } from './connection';
import { byId, element, setText } from './dom';
import { EventsPanel } from './events_panel';
import { duration, fixed, timeOfDay } from './format';
import { LogPanel } from './log_panel';
import { mapLine } from './map_line';
import { MapCommands } from './map_commands';
import { MapPanel } from './map_panel';
import { controlUrl } from './operator';
import type { Frame, Hello, Message, TagMap, TagState } from './protocol';
import { reader } from './reader';
import { Scene3D } from './scene3d';
import type { Guide } from './setup/guide';
import { askForSetup, keepSecret, remembered, type SecondHalf } from './setup/memory';
import { SteadyStates } from './steady';
import { TAG_COLOUR } from './theme';

const TAG_STATES: TagState[] = ['surveyed', 'calibrated', 'local', 'quarantined'];
const LOOK_FOR_SETUP_MS = 3000;
const CHART_TITLE: Record<ChartQuantity, string> = { sigma: 'Position uncertainty 1σ, mm', latency: 'Latency from image to pose, ms' };

/** Wires the panels to the messages. */
class Page {
  private readonly scene = makeScene((tag) => this.pointAt(tag));
  private readonly bodies = new BodiesTable(byId('bodies'), (id) => this.choose(id));
  private readonly clients = new ClientsPanel(byId('clients'), byId('clients-summary'));
  private readonly log = new LogPanel(byId('log'));
  private readonly events = new EventsPanel(byId('alarms-banner'), byId('alarms'), byId('alarms-more'), byId('events'), byId('alarms-summary'));
  private readonly chart = new StripChart(byId('chart'));
  private readonly commands = new MapCommands(controlUrl(document.baseURI));
  private readonly versions = new MapPanel(byId('versions'), this.commands, {
    compared: (diff) => this.scene?.setChanges(diff?.changes ?? []),
    chosen: (tag) => this.scene?.chooseTag(tag),
  });
  private readonly states = new SteadyStates();
  private cameras: CamerasPanel | null = null;
  private guide: Guide | null = null;
  private lookedForSetupAt = 0;
  private hello: Hello | null = null;
  private map: TagMap | null = null;
  private chosen: number | null = null;

  constructor() {
    this.wireTools();
  }

  /** The second half of a set-up. */
  guideBy(Guided: typeof Guide, half: SecondHalf): void {
    this.guide = new Guided(half, { commands: this.commands, showMap: () => this.showList('versions') });
  }

  opened(): void {
    this.log.restart();
    this.versions.restart();
    this.cameras?.restart();
  }

  receive(message: Message): void {
    switch (message.type) {
      case 'hello':
        return this.onHello(message);
      case 'events':
        this.commands.heard(message.events);
        this.guide?.onEvents(message.events);
        return this.events.update(message);
      case 'map':
        return this.onMap(message);
      case 'fits':
        return this.versions.updateFits(message.tags);
      case 'frame':
        return this.onFrame(message);
      case 'clients':
        return this.clients.update(message.clients);
      case 'log':
        this.guide?.onLog(message.lines);
        return this.log.add(message.lines);
    }
  }

  link(state: LinkState, silentMs: number | null): void {
    if (state === 'offline') void this.lookForSetup();
    document.body.dataset.link = state;
    setText(byId('link-text'), linkText(state, silentMs, this.hello?.pageRateHz ?? null));
  }

  private onHello(hello: Hello): void {
    // A wall screen outlives its server: a newer one brings a newer page.
    if (this.hello && this.hello.version !== hello.version) return location.reload();
    const sameBodies = JSON.stringify(this.hello?.bodies) === JSON.stringify(hello.bodies);
    this.hello = hello;
    this.commands.setServer(hello.takesCommands, hello.mapMode);
    setText(byId('server-name'), `${hello.server} ${hello.version}`.trim());
    document.title = `${hello.server} – Fiducap`;
    if (!sameBodies) {
      this.bodies.setBodies(hello.bodies);
      this.cameras?.setBodies(hello.bodies);
      this.scene?.setBodies(hello.bodies);
      this.chart.setBodies(hello.bodies);
      this.showFollowing(false);
    }
    if (this.map) this.onMap(this.map);
    this.guide?.onHello(hello);
    if (hello.bodies.length === 0) void this.lookForSetup();
  }

  /** A server without robots, or without live data, may be in set-up. */
  private async lookForSetup(): Promise<void> {
    const now = performance.now();
    if (now - this.lookedForSetupAt < LOOK_FOR_SETUP_MS) return;
    this.lookedForSetupAt = now;
    const { isGoingOn, refusal } = await askForSetup(document.baseURI);
    if (isGoingOn || refusal !== '') location.reload();
  }

  private onMap(map: TagMap): void {
    if (map !== this.map) {
      this.scene?.setMap(map.tags);
      showLegend(map);
      this.versions.update(map);
      this.commands.setMap(map.tags);
      this.guide?.onTags(map.tags.length);
    }
    this.map = map;
    setText(byId('map-line'), mapLine(map, this.hello?.mapMode ?? ''));
  }

  private onFrame(frame: Frame): void {
    this.versions.setTime(frame.utcMs);
    this.cameras?.setTime(frame.utcMs);
    const bodies = this.states.take(frame.bodies, frame.utcMs);
    this.bodies.update(bodies);
    this.guide?.onBodies(bodies);
    this.scene?.setFrame(bodies, 1000 / (this.hello?.pageRateHz ?? 20));
    this.chart.add(frame.utcMs, frame.bodies);
    setText(byId('server-rate'), fixed(frame.rateHz, 0));
    setText(byId('clock'), timeOfDay(frame.utcMs));
  }

  /** At a tag, in the room. */
  private pointAt(tag: number): void {
    this.showList('versions');
    this.versions.choose(tag);
  }

  private choose(id: number): void {
    this.chosen = this.chosen === id ? null : id;
    this.bodies.choose(this.chosen);
    this.scene?.choose(this.chosen);
  }

  private showFollowing(following: boolean): void {
    byId('view-follow').setAttribute('aria-pressed', String(following));
  }

  private wireTools(): void {
    const tools: Record<string, () => void> = {
      'view-fit': () => this.showRoom('oblique'),
      'view-top': () => this.showRoom('top'),
      'view-follow': () => {
        const on = byId('view-follow').getAttribute('aria-pressed') !== 'true';
        this.showFollowing(this.scene?.follow(on) ?? false);
      },
      'view-sigma': () => {
        const scale = this.scene?.nextSigmaScale() ?? 0;
        setText(byId('view-sigma'), scale === 0 ? '1σ off' : `1σ × ${scale}`);
      },
    };
    for (const [id, act] of Object.entries(tools)) byId(id).addEventListener('click', act);
    const keys: Record<string, string> = { r: 'view-fit', t: 'view-top', f: 'view-follow', e: 'view-sigma' };
    document.addEventListener('keydown', (event) => {
      if (event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement) return;
      const id = keys[event.key.toLowerCase()];
      if (id && !event.ctrlKey && !event.metaKey && !event.altKey) tools[id]?.();
    });
    for (const button of document.querySelectorAll<HTMLButtonElement>('[data-chart]')) {
      button.addEventListener('click', () => this.showChart(button.dataset.chart as ChartQuantity));
    }
    for (const button of document.querySelectorAll<HTMLButtonElement>('[data-list]')) {
      button.addEventListener('click', () => this.showList(button.dataset.list ?? 'log'));
    }
  }

  private showList(chosen: string): void {
    showList(chosen);
    if (chosen === 'versions') void this.versions.refresh();
    void this.showCameras(chosen === 'cameras');
  }

  /** The panel of pictures is loaded when it is first opened: most visitors never do. */
  private async showCameras(shown: boolean): Promise<void> {
    if (shown && !this.cameras) {
      const { CamerasPanel } = await import('./cameras_panel');
      this.cameras ??= new CamerasPanel(byId('cameras'), document.baseURI, () => this.commands.token ?? reader.token, () => this.showList('versions'));
      this.cameras.setBodies(this.hello?.bodies ?? []);
    }
    this.cameras?.show(document.body.dataset.list === 'cameras');
  }

  private showRoom(from: 'oblique' | 'top'): void {
    this.scene?.showRoom(from);
    this.showFollowing(false);
  }

  private showChart(quantity: ChartQuantity): void {
    this.chart.show(quantity);
    setText(byId('chart-title'), CHART_TITLE[quantity]);
    for (const button of document.querySelectorAll<HTMLButtonElement>('[data-chart]')) {
      button.setAttribute('aria-pressed', String(button.dataset.chart === quantity));
    }
  }
}

/** Log, events, map and cameras share a place; the larger ones take some of the bodies'. */
function showList(chosen: string): void {
  byId('bodies').classList.toggle('brief', chosen === 'versions' || chosen === 'cameras');
  for (const button of document.querySelectorAll<HTMLButtonElement>('[data-list]')) {
    const shown = button.dataset.list === chosen;
    button.setAttribute('aria-pressed', String(shown));
    byId(button.dataset.list ?? 'log').hidden = !shown;
    if (shown) document.body.dataset.list = button.dataset.list;
    if (shown) setText(byId('log-title'), button.textContent ?? '');
  }
}

/** `calibrated 14`, each in its colour; zero counts are left out. */
function showLegend(map: TagMap): void {
  const items = TAG_STATES.flatMap((state) => {
    const number = map.tags.filter((tag) => tag.state === state).length;
    if (number === 0) return [];
    const item = element('li', '', `${number} ${state}`);
    item.style.setProperty('--tag', TAG_COLOUR[state]);
    return [item];
  });
  byId('legend').replaceChildren(...items);
}

/** Without WebGL everything but the picture still works. */
function makeScene(pointed: (tag: number) => void): Scene3D | null {
  try {
    return new Scene3D(byId('stage'), window.matchMedia('(prefers-reduced-motion: reduce)').matches, pointed);
  } catch (error) {
    console.warn('no 3D view:', error);
    const notice = byId('stage-notice');
    notice.hidden = false;
    setText(notice, 'This browser offers no WebGL, so the room is not drawn. The numbers are complete.');
    return null;
  }
}

function linkText(state: LinkState, silentMs: number | null, rateHz: number | null): string {
  const { value, unit } = duration(silentMs);
  const silent = silentMs === null ? '' : ` · data ${value} ${unit} old`;
  switch (state) {
    case 'live':
      return rateHz === null ? 'Live' : `Live · ${fixed(rateHz, 0)} Hz`;
    case 'stale':
      return `No new frames${silent}`;
    case 'offline':
      return `Reconnecting${silent}`;
    case 'connecting':
      return 'Connecting';
  }
}

/** The set-up, and the bar of its second half, are loaded when they are needed. */
async function begin(): Promise<void> {
  keepSecret();
  // An address that is typed over the one of an open page loads nothing by itself.
  addEventListener('hashchange', () => keepSecret() && location.reload());
  const { isGoingOn, refusal } = await askForSetup(document.baseURI);
  if (isGoingOn || refusal !== '') {
    const { SetupPanel } = await import('./setup/panel');
    const panel = new SetupPanel(document.baseURI);
    return isGoingOn ? panel.start() : panel.refuseAll(refusal);
  }
  const page = new Page();
  const half = remembered();
  if (half) page.guideBy((await import('./setup/guide')).Guide, half);
  new Connection(liveUrl(document.baseURI), {
    opened: () => page.opened(),
    message: (message) => page.receive(message),
    link: (state, silentMs) => page.link(state, silentMs),
  }).start();
}

void begin();
