// The live socket and the control channel of a server after its set-up, as the page sees them.

const SQRT = Math.SQRT1_2;
const tag = (id, x) => ({
  id, edge_m: 0.16, state: 'calibrated', component: 0, sightings: 80, last_seen_utc_ms: 0,
  p: [x, 2, 1.2], q: [SQRT, SQRT, 0, 0], sigma_mm: 2, cov: null,
});
const line = (n, module, text) => ({ n, utc_ms: 1.79e12, level: 'info', module, text });

function messages(mode, number) {
  return [
    {
      type: 'hello', server: 'lab', version: '0.1.0', map_mode: mode, page_rate_hz: 20,
      takes_commands: true, bodies: [{ id: 1, name: 'robot' }],
    },
    { type: 'events', standing: [], events: [] },
    {
      type: 'map', version: 4, family: 'tag36h11', reference_tag: 0,
      tags: [tag(0, 0), tag(3, 1), tag(7, 2)],
    },
    {
      type: 'log',
      lines: [
        line(1, 'vrpn', 'serves VRPN 07.35 on 0.0.0.0:3883'),
        line(2, 'natnet', 'serves NatNet 2.0 to 4.1 on 0.0.0.0:1510'),
        line(3, 'web', 'page at http://192.168.1.4:8080/'),
      ],
    },
    frame(number),
  ];
}

function frame(number) {
  const angle = number / 40;
  return {
    type: 'frame', number, utc_ms: 1.79e12 + 50 * number, rate_hz: 200,
    bodies: [
      {
        id: 1, state: 'tracking', valid: true, p: [Math.cos(angle), Math.sin(angle), 0.8],
        q: [1, 0, 0, 0], speed: 0.5, sigma_mm: 2.4, sigma_deg: 0.1, cov: null, age_ms: 5,
        latency_ms: 12, tags: 2, image_rate_hz: 20, reprojection_px: 0.3, images_dropped: 0,
      },
    ],
  };
}

const behindLength = (...bytes) => Buffer.from([bytes.length, 0, 0, 0, ...bytes]);
const CHALLENGE = behindLength(0x22, 3, 0x0a, 1, 9);
const DONE = behindLength(0x10, 0);
const FREEZE = Buffer.from([0x1a, 2, 0x2a, 0]);

/** One tracked robot and three tags; accepts every token. */
export async function liveRobot(page) {
  let mode = 'mapping';
  const open = new Set();
  const tell = (socket, number) => {
    for (const message of messages(mode, number)) socket.send(JSON.stringify(message));
  };
  await page.routeWebSocket(/\/api\/v1\/live$/, (socket) => {
    let number = 0;
    open.add(socket);
    tell(socket, number);
    const timer = setInterval(() => socket.send(JSON.stringify(frame(++number))), 50);
    timer.unref(); // a closed page sends nothing
    socket.onClose(() => {
      clearInterval(timer);
      open.delete(socket);
    });
  });
  await page.routeWebSocket(/\/api\/v1\/control$/, (socket) => {
    socket.send(CHALLENGE);
    socket.onMessage((request) => {
      if (Buffer.from(request).subarray(-FREEZE.length).equals(FREEZE)) mode = 'frozen';
      socket.send(DONE);
      for (const one of open) tell(one, 0);
    });
  });
}
