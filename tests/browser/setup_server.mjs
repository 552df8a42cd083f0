// A server during its set-up, as the page sees it. A step advances with each requested state.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import { extname, join, normalize } from 'node:path';

const NAMES = ['camera', 'picture', 'sheet', 'lens', 'imu', 'rest', 'mount', 'wave', 'finish'];
const TYPES = {
  '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml',
};
// As the real one sends it.
const POLICY =
  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; " +
  "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const CAMERAS = [
  { open: '/dev/video0', name: 'HD Webcam (uvcvideo)', problem: '' },
  {
    open: '/dev/video2', name: 'Global shutter camera (uvcvideo)',
    problem: 'Another program has opened it.',
  },
  { open: 'simulated', name: 'a simulated robot with camera and IMU', problem: '' },
];
const YAML = `# Written by the set-up.
tags:
  family: tag36h11
  default_edge_m: 0.4
bodies:
  - name: robot
    cameras:
      - type: v4l2
        device: /dev/video0
        exposure_ms: 2.5          # as it was set
        lens: {model: pinhole_radtan, fu: 458.6, fv: 457.3, cu: 367.2, cv: 248.4}
        X_BV: {p: [0.1, 0, -0.02], q_wxyz: [0.5, -0.5, 0.5, -0.5]}
    imu: {type: line, device: /dev/ttyACM0, baud: 115200}
`;

export const SECRET = '00112233445566778899aabbccddeeff';
const REFUSAL = 'Open the address that fiducapd --setup printed in its terminal, with everything after #.\n';

export class SetupServer {
  heard = [];
  /** Progress of a step per state. */
  pace = 0.25;
  /** The next result of the lens. */
  refusals = 1;
  fileExists = true;
  /** Sent instead of a state, if set. */
  garbage = '';
  /** It runs with its configuration. */
  isOver = false;
  pictures = 0;
  sockets = new Set();

  /** @param root  the bundled page. @param jpegs  by step, `other` for the rest */
  constructor(root, jpegs) {
    this.root = root;
    this.jpegs = jpegs;
    this.reset();
    this.server = createServer((request, response) => void this.answer(request, response));
    this.server.on('connection', (socket) => {
      this.sockets.add(socket);
      socket.on('close', () => this.sockets.delete(socket));
    });
  }

  reset() {
    this.at = 0;
    this.done = 0;
    this.verdict = null;
    this.solving = 0;
    this.camera = null;
    this.error = '';
    this.sheet = { family: 'tag36h11', size_mm: 160, families: ['tag36h11', 'DICT_4X4_50'] };
    this.imu = { used: false, rate_hz: 0 };
    this.written = false;
    this.results = new Set();
  }

  listen(port = 0) {
    return new Promise((resolve) => {
      this.server.listen(port, '127.0.0.1', () => resolve(this.server.address().port));
    });
  }

  /** As after a restart of the process: no client is connected. */
  stop() {
    return new Promise((resolve) => {
      this.server.close(() => resolve());
      for (const socket of this.sockets) socket.destroy();
    });
  }

  get step() {
    return NAMES[this.at];
  }

  get hasImu() {
    return this.imu.used;
  }

  async answer(request, response) {
    const url = new URL(request.url, 'http://127.0.0.1');
    response.setHeader('Content-Security-Policy', POLICY);
    if (this.isOver && url.pathname.startsWith('/api/')) return this.sayRunning(url, response);
    const isOfSetup = url.pathname.startsWith('/api/v1/setup');
    if (isOfSetup && request.headers['x-fiducap-setup'] !== SECRET) return response.writeHead(403).end(REFUSAL);
    if (url.pathname === '/api/v1/setup') return this.sayState(response);
    if (url.pathname === '/api/v1/setup/picture') return this.sayPicture(response);
    if (url.pathname === '/api/v1/setup/sheet' && request.method === 'GET') return this.saySheet(url, response);
    if (url.pathname.startsWith('/api/v1/setup/')) return this.hear(url, request, response);
    const name = url.pathname === '/' ? '/index.html' : normalize(url.pathname);
    const content = await readFile(join(this.root, name)).catch(() => null);
    const type = TYPES[extname(name)] ?? 'text/plain';
    response.writeHead(content ? 200 : 404, { 'Content-Type': type });
    response.end(content ?? 'no such file');
  }

  sayRunning(url, response) {
    const known = { '/api/v1/map/versions': '{"versions":[]}', '/api/v1/setup': 'null' }[url.pathname];
    response.writeHead(known ? 200 : 404).end(known ?? 'none');
  }

  sayState(response) {
    this.goOn();
    response.writeHead(200, { 'Content-Type': 'application/json' });
    response.end(this.garbage || JSON.stringify(this.state()));
  }

  sayPicture(response) {
    if (!this.camera) return response.writeHead(404).end();
    this.pictures += 1;
    response.writeHead(200, { 'Content-Type': 'image/jpeg' });
    response.end((this.jpegs[this.step] ?? this.jpegs.other).jpeg);
  }

  saySheet({ searchParams }, response) {
    if (Number(searchParams.get('size_mm')) > 200)
      return response.writeHead(400).end('such a tag does not fit; up to 161 mm do\n');
    response.writeHead(200, { 'Content-Type': 'application/pdf' });
    response.end(`%PDF of ${searchParams}`);
  }

  hear(url, request, response) {
    const name = url.pathname.split('/').pop();
    const values = Object.fromEntries(url.searchParams);
    if (request.method !== 'POST') return response.writeHead(405).end();
    this.heard.push({ name, values });
    if (name === 'settings' && Number(values.exposure_ms) > 500) {
      return response.writeHead(409).end('The camera exposes for 500 ms at most.\n');
    }
    this.error = '';
    this.obey(name, values);
    response.writeHead(202).end();
  }

  obey(name, values) {
    const deeds = {
      look: () => {},
      camera: () => {
        this.camera = { open: values.open, exposure_ms: values.open === 'simulated' ? null : 20 };
      },
      settings: () => (this.camera.exposure_ms = Number(values.exposure_ms)),
      sheet: () => Object.assign(this.sheet, {
        family: values.family,
        size_mm: Number(values.size_mm),
      }),
      guess: () => this.move(1), // as the real one
      imu: () => (this.imu = { used: values.source !== '', rate_hz: values.source ? 198.6 : 0 }),
      mount: () => {},
      again: () => this.enter(this.at),
      next: () => this.move(1),
      back: () => this.move(-1),
      write: () => this.write(values),
    };
    deeds[name]();
  }

  write(values) {
    if (this.fileExists && values.replace !== 'yes') {
      this.error = '/home/lab/robot.yaml exists already: allow to replace it.';
      return;
    }
    this.written = true;
    this.onWritten?.();
  }

  move(by) {
    const isLeftOut = (i) => !this.hasImu && (NAMES[i] === 'rest' || NAMES[i] === 'wave');
    let to = this.at + by;
    while (isLeftOut(to)) to += by;
    if (to >= 0 && to < NAMES.length) this.enter(to);
  }

  enter(at) {
    this.at = at;
    this.done = 0;
    this.verdict = null;
    this.solving = 0;
  }

  goOn() {
    if (!['lens', 'rest', 'wave'].includes(this.step) || this.verdict) return;
    if (this.done < 1) return (this.done = Math.min(1, this.done + this.pace));
    if (++this.solving < 3) return;
    this.solving = 0;
    this.verdict = this.outcome();
    if (!this.verdict.refused) this.results.add(this.step);
  }

  isSkipped(name) {
    const hasResult = ['lens', 'rest', 'wave'].includes(name) && !(name !== 'lens' && !this.hasImu);
    return hasResult && NAMES.indexOf(name) < this.at && !this.results.has(name);
  }

  outcome() {
    if (this.step === 'rest') return verdictOf(true, false, 'Gyroscope 0.0021 rad/s/√Hz');
    if (this.step === 'wave') {
      return verdictOf(false, false, 'Camera 10.2 cm ahead, clock 4.1 ms late', [
        'Up to 3 mm are open in height: pitch it more, if that matters to you.',
      ]);
    }
    if (this.refusals-- > 0) {
      return verdictOf(false, true, 'Two focal lengths of 1176 and 1504 px: no lens is like that', [
        'Tilt the sheet by 30 degrees and more; all views were from the front.',
      ]);
    }
    return verdictOf(true, false, '31 views, 0.21 px, 96 % of the image');
  }

  state() {
    const { jpegs, done, step } = this;
    const left = Math.round(60 * (1 - done));
    const isSharp = this.camera?.exposure_ms === null || this.camera?.exposure_ms <= 10;
    return {
      step,
      steps: NAMES.map((name) => ({
        name, left_out: !this.hasImu && (name === 'rest' || name === 'wave'), skipped: this.isSkipped(name),
      })),
      file: '/home/lab/robot.yaml',
      exists: this.fileExists,
      missing: step === 'lens' && !this.results.has('lens')
        ? 'the lens is not known yet: continue with the images, or use a guess' : '',
      error: this.error,
      solving: this.solving > 0,
      cameras: CAMERAS,
      camera: this.camera,
      picture: this.camera && {
        width: 752, height: 480, rate_hz: 19.9,
        histogram: Array.from({ length: 64 }, (_, i) => 900 * Math.exp(-(((i - 24) / 14) ** 2))),
        bright_share: isSharp ? 0.01 : 0.17, dark_share: 0.1, focus_px: 2.1,
        motion_px: isSharp ? 0.3 : 6.4,
        verdict: isSharp ? 'Well exposed and sharp.' : '17 % is too bright: expose shorter.',
        good: isSharp, outlines: (jpegs[step] ?? jpegs.other).outlines,
      },
      sheet: this.sheet,
      lens: this.at < 3 ? null : this.lens(done),
      imu: {
        ...this.imu, simulated: this.camera?.open === 'simulated',
        types: ['line', 'mavlink', 'iio', 'px4', 'ros'],
        parts: ['icm-42688-p', 'bmi088', 'icm-20948', 'mpu-6050', 'lsm6dso'],
      },
      rest: step === 'rest'
        ? { share: done, hint: `Let it lie on a table, do not touch it: ${left} s more.` }
        : null,
      wave: step === 'wave'
        ? {
          turned: [Math.min(1, 1.5 * done), done >= 1 ? 1 : 0.6 * done, done],
          shaken: done, seen: done,
          hint: 'Quickly back and forth, with the tags in view: pitch it up and down.',
        }
        : null,
      verdict: this.verdict,
      written: this.written,
      configuration: step === 'finish' ? YAML : '',
    };
  }

  lens(done) {
    const covered = Math.round(40 * done);
    const points = Array.from({ length: 40 }, (_, i) => (i < covered ? 3 : +(i < covered + 3)));
    return {
      columns: 8, rows: 5, points, covered: covered / 40, views: Math.round(31 * done),
      tilted: Math.round(12 * done),
      hint: 'Move it to the lower right of the image, up to the border.', enough: done >= 1,
    };
  }
}

function verdictOf(good, refused, summary, advice = []) {
  return { good, refused, summary, advice };
}
