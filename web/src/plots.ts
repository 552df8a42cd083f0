// Draws the plots of an HTML report of `fiducap` (server/tools/plot/plot_page.cpp). Bundled alone, with
// uPlot, as plots.js; `fiducap` writes it into each report.
/// <reference types="vite/client" />
import uPlot from 'uplot';
import uplotCss from 'uplot/dist/uPlot.min.css?inline';

/** Flat lists of numbers; null: not to be drawn. */
type Numbers = (number | null)[];

interface Named {
  name: string;
  color: string;
}
export interface Panel {
  yLabel: string;
  yLog: boolean;
  y: [number, number];
  goal: number | null;
  bands: { from: number; to: number; name: string }[];
  spans: { name: string; fromTo: Numbers }[];
  areas: (Named & { slices: Numbers })[]; // x, low, high
  columns: (Named & { filled: boolean; columns: Numbers })[]; // from, to, height
  lines: (Named & { dashed: boolean; width: number; dots: boolean; points: Numbers })[]; // x, y
  marks: (Named & { at: Numbers })[];
  shapes: (Named & { filled: boolean; shapes: { outline: Numbers; label: string }[] })[];
}
export interface Plot {
  xLabel: string;
  xLog: boolean;
  x: [number, number];
  equal: boolean;
  yDown: boolean;
  height: number;
  panels: Panel[];
}

const FONT = '12px system-ui, sans-serif';
const Y_AXIS = 64;
const X_AXIS = 48;
const PADDING: [number, number, number, number] = [8, 16, 0, 0];
const BAND = '#e6c84a';
const SPAN = '#8a93a0';
const GOAL = '#2e7d32';
const LEAST_WIDTH = 0.8; // of a shaded part, so that a short one is visible
const LEAST_SHAPE = 4;

/** Widens one of two intervals about its centre, so that a unit has the same length on both axes. */
export function equalRanges(
  x: [number, number],
  y: [number, number],
  width: number,
  height: number,
): [[number, number], [number, number]] {
  const margin = 1.08;
  const unit = Math.max((margin * (x[1] - x[0])) / width, (margin * (y[1] - y[0])) / height);
  const about = (range: [number, number], length: number): [number, number] => {
    const centre = (range[0] + range[1]) / 2;
    return [centre - (unit * length) / 2, centre + (unit * length) / 2];
  };
  return [about(x, width), about(y, height)];
}

function panelHeight(plot: Plot, panel: Panel, width: number): number {
  if (plot.equal) {
    const shape = (panel.y[1] - panel.y[0]) / (plot.x[1] - plot.x[0]);
    return Math.min(620, Math.max(120, width * shape));
  }
  return plot.height || (plot.panels.length === 1 ? 300 : 190);
}

/** What is drawn into one plot area; uPlot has drawn the grid already. */
class Painter {
  private readonly ctx: CanvasRenderingContext2D;
  private readonly scale = devicePixelRatio;

  constructor(
    private readonly plot: uPlot,
    private readonly panel: Panel,
    private readonly ink: string,
  ) {
    this.ctx = plot.ctx;
  }

  paint(): void {
    const { left, top, width, height } = this.plot.bbox;
    this.ctx.save();
    this.ctx.beginPath();
    this.ctx.rect(left, top, width, height);
    this.ctx.clip();
    this.ctx.font = `${12 * this.scale}px system-ui, sans-serif`;
    this.ctx.lineCap = this.ctx.lineJoin = 'round';
    this.shade();
    for (const area of this.panel.areas) this.area(area.slices, area.color);
    for (const { columns, color, filled } of this.panel.columns) this.columns(columns, color, filled);
    for (const line of this.panel.lines) this.line(line.points, line.color, line.width, line.dashed, line.dots);
    if (this.panel.goal !== null) this.goal(this.panel.goal);
    for (const marks of this.panel.marks)
      for (const at of marks.at) this.vertical(at, marks.color);
    for (const { shapes, color, filled } of this.panel.shapes)
      for (const shape of shapes) this.shape(shape.outline, color, filled);
    this.labels();
    this.ctx.restore();
  }

  private px(x: number): number {
    return this.plot.valToPos(x, 'x', true);
  }
  private py(y: number): number {
    return this.plot.valToPos(y, 'y', true);
  }
  private color(name: string): string {
    return name === 'ink' ? this.ink : name;
  }
  private fill(color: string, opacity: number): void {
    this.ctx.globalAlpha = opacity;
    this.ctx.fillStyle = this.color(color);
    this.ctx.fill();
    this.ctx.globalAlpha = 1;
  }
  private stroke(color: string, width: number, dash: number[] = []): void {
    this.ctx.strokeStyle = this.color(color);
    this.ctx.lineWidth = width * this.scale;
    this.ctx.setLineDash(dash.map((part) => part * this.scale));
    this.ctx.stroke();
    this.ctx.setLineDash([]);
  }

  private shade(): void {
    const { top, height } = this.plot.bbox;
    const box = (from: number | null, to: number | null, color: string): void => {
      if (from === null || to === null) return;
      this.ctx.beginPath();
      this.ctx.rect(this.px(from), top, Math.max(LEAST_WIDTH * this.scale, this.px(to) - this.px(from)), height);
      this.fill(color, 0.25);
    };
    for (const band of this.panel.bands) {
      box(band.from, band.to, BAND);
      this.ctx.fillStyle = this.ink;
      this.ctx.fillText(band.name, this.px(band.from) + 4 * this.scale, top + 14 * this.scale);
    }
    for (const { fromTo } of this.panel.spans)
      for (let i = 0; i < fromTo.length; i += 2) box(fromTo[i] ?? null, fromTo[i + 1] ?? null, SPAN);
  }

  private area(slices: Numbers, color: string): void {
    let upper: [number, number][] = [];
    let lower: [number, number][] = [];
    const flush = (): void => {
      this.ctx.beginPath();
      for (const [x, y] of [...upper, ...lower.reverse()]) this.ctx.lineTo(x, y);
      this.ctx.closePath();
      this.fill(color, 0.2);
      upper = [];
      lower = [];
    };
    for (let i = 0; i < slices.length; i += 3) {
      const [x, low, high] = [slices[i], slices[i + 1], slices[i + 2]];
      if (typeof x !== 'number' || typeof low !== 'number' || typeof high !== 'number') {
        flush();
        continue;
      }
      upper.push([this.px(x), this.py(high)]);
      lower.push([this.px(x), this.py(low)]);
    }
    flush();
  }

  private columns(columns: Numbers, color: string, filled: boolean): void {
    const { top, height } = this.plot.bbox;
    for (let i = 0; i < columns.length; i += 3) {
      const left = this.px(columns[i] ?? 0);
      const y = this.py(columns[i + 2] ?? 0);
      this.ctx.beginPath();
      this.ctx.rect(left, y, this.px(columns[i + 1] ?? 0) - left, top + height - y);
      if (filled) this.fill(color, 0.45);
      this.stroke(color, 1);
    }
  }

  private line(points: Numbers, color: string, width: number, dashed: boolean, dots: boolean): void {
    this.ctx.beginPath();
    let connected = false;
    for (let i = 0; i < points.length; i += 2) {
      const [x, y] = [points[i], points[i + 1]];
      if (typeof x !== 'number' || typeof y !== 'number') {
        connected = false;
        continue;
      }
      if (!connected) this.ctx.moveTo(this.px(x), this.py(y));
      this.ctx.lineTo(this.px(x), this.py(y)); // also a single point is visible: round caps
      connected = !dots;
    }
    this.stroke(color, width, dashed ? [6, 4] : []);
  }

  private goal(y: number): void {
    const { left, width } = this.plot.bbox;
    this.ctx.beginPath();
    this.ctx.moveTo(left, this.py(y));
    this.ctx.lineTo(left + width, this.py(y));
    this.stroke(GOAL, 1.4, [6, 4]);
  }

  private vertical(x: number | null, color: string): void {
    if (x === null) return;
    const { top, height } = this.plot.bbox;
    this.ctx.beginPath();
    this.ctx.moveTo(this.px(x), top);
    this.ctx.lineTo(this.px(x), top + height);
    this.stroke(color, 1.2, [3, 2]);
  }

  private corners(outline: Numbers): [number, number][] {
    const corners: [number, number][] = [];
    for (let i = 0; i < outline.length; i += 2) {
      const [x, y] = [outline[i], outline[i + 1]];
      if (typeof x === 'number' && typeof y === 'number') corners.push([this.px(x), this.py(y)]);
    }
    return corners;
  }

  private shape(outline: Numbers, color: string, filled: boolean): void {
    const corners = this.corners(outline);
    const first = corners[0];
    if (!first) return;
    const least = LEAST_SHAPE * this.scale;
    this.ctx.beginPath();
    if (corners.every(([x, y]) => Math.hypot(x - first[0], y - first[1]) < least)) {
      this.ctx.rect(first[0] - least / 2, first[1] - least / 2, least, least);
    } else {
      for (const [x, y] of corners) this.ctx.lineTo(x, y);
      this.ctx.closePath();
    }
    if (filled) this.fill(color, 0.45);
    this.stroke(color, 1.6);
  }

  /** Beside their shapes; those that would overlap another one are left out. */
  private labels(): void {
    const height = 12 * this.scale;
    const taken: { left: number; right: number; y: number }[] = [];
    this.ctx.fillStyle = this.ink;
    for (const { shapes } of this.panel.shapes)
      for (const { outline, label } of shapes) {
        const corners = this.corners(outline);
        if (!label || corners.length === 0) continue;
        const left = Math.max(...corners.map(([x]) => x)) + 3 * this.scale;
        const right = left + this.ctx.measureText(label).width;
        const y = corners.reduce((sum, corner) => sum + corner[1], 0) / corners.length;
        if (taken.some((one) => left < one.right && one.left < right && Math.abs(one.y - y) < height)) continue;
        taken.push({ left, right, y });
        this.ctx.fillText(label, left, y + height / 3);
      }
  }
}

function legendOf(panel: Panel, ink: string): HTMLElement {
  const legend = document.createElement('div');
  legend.className = 'legend';
  const add = (name: string, color: string, isLine: boolean): void => {
    if (!name) return;
    const entry = document.createElement('span');
    const sample = document.createElement('i');
    sample.className = isLine ? 'line' : 'box';
    sample.style.color = sample.style.background = color === 'ink' ? ink : color;
    entry.append(sample, name);
    legend.append(entry);
  };
  for (const line of panel.lines) add(line.name, line.color, true);
  for (const area of panel.areas) add(area.name, area.color, false);
  for (const columns of panel.columns) add(columns.name, columns.color, false);
  for (const group of panel.shapes) if (group.shapes.length > 0) add(group.name, group.color, false);
  for (const marks of panel.marks) if (marks.at.length > 0) add(marks.name, marks.color, true);
  for (const spans of panel.spans) if (spans.fromTo.length > 0) add(spans.name, SPAN, false);
  if (panel.goal !== null) add('goal', GOAL, true);
  return legend;
}

/** Draws one panel; dragging zooms all panels of the plot, a double click shows everything again. */
function drawPanel(plot: Plot, panel: Panel, host: HTMLElement, sync: string, ink: string): uPlot {
  const isLast = panel === plot.panels[plot.panels.length - 1];
  const width = Math.max(240, host.clientWidth);
  const areaWidth = width - Y_AXIS - PADDING[1];
  const areaHeight = panelHeight(plot, panel, areaWidth);
  const [x, y] = plot.equal ? equalRanges(plot.x, panel.y, areaWidth, areaHeight) : [plot.x, panel.y];
  const grid = { stroke: '#8a93a040', width: 1 };
  const axis = { stroke: ink, grid, ticks: grid, font: FONT, labelFont: FONT };
  return new uPlot(
    {
      width,
      height: areaHeight + PADDING[0] + (isLast ? X_AXIS : 10),
      padding: PADDING,
      legend: { show: false },
      cursor: { sync: { key: sync }, drag: { x: true, y: plot.equal }, points: { show: false } },
      scales: {
        x: { time: false, distr: plot.xLog ? 3 : 1, range: x },
        y: { distr: panel.yLog ? 3 : 1, range: () => y, dir: plot.yDown ? -1 : 1 },
      },
      axes: [
        isLast
          ? { ...axis, size: 28, label: plot.xLabel, labelSize: 20 }
          : { ...axis, size: 10, values: (_, ticks) => ticks.map(() => '') },
        { ...axis, size: Y_AXIS - 20, label: panel.yLabel, labelSize: 20 },
      ],
      series: [{}, {}],
      hooks: { draw: [(drawn) => new Painter(drawn, panel, ink).paint()] },
    },
    [x, [null, null]],
    host,
  );
}

/** Draws a plot into its element, again whenever the width changes. */
function drawPlot(plot: Plot, host: HTMLElement, number: number): void {
  let width = 0;
  const draw = (): void => {
    if (host.clientWidth === width) return;
    width = host.clientWidth;
    host.replaceChildren();
    const ink = getComputedStyle(document.body).color;
    for (const panel of plot.panels) {
      host.append(legendOf(panel, ink));
      drawPanel(plot, panel, host, `plot ${number}`, ink);
    }
  };
  new ResizeObserver(draw).observe(host);
  draw();
}

if (typeof document !== 'undefined') {
  const data = document.getElementById('plots');
  const style = document.createElement('style');
  style.textContent = uplotCss;
  document.head.append(style);
  const hosts = document.querySelectorAll<HTMLElement>('div.plot');
  const plots = JSON.parse(data?.textContent ?? '[]') as Plot[];
  plots.forEach((plot, number) => {
    const host = hosts[number];
    if (host) drawPlot(plot, host, number);
  });
}
