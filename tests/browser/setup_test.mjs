// The set-up in a real browser: from "no camera yet" to the addresses for clients, by visible buttons.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { button, press, runSteps, shoot, step, title, waitForText, watchDrawing, world } from './harness.mjs';
import { liveRobot } from './setup_live.mjs';
import { paintPictures } from './setup_pictures.mjs';
import { SECRET, SetupServer } from './setup_server.mjs';

const ROOT = join(dirname(process.argv[2]), 'web');
const WIDE = { viewport: { width: 1280, height: 800 }, reducedMotion: 'reduce' };
const PHONE = {
  viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, reducedMotion: 'reduce',
};
const TOKEN_FILE = '/home/lab/robot.token';

let server;
const text = (selector) => world.page.textContent(selector);
const lastHeard = (name) => server.heard.filter((one) => one.name === name).pop()?.values;

/** At both sizes. Nothing may be wider than the screen, and all buttons are reachable. */
async function look(name) {
  const { page } = world;
  await page.waitForTimeout(400); // the newest picture is drawn
  for (const [size, { viewport }] of [['', WIDE], ['-phone', PHONE]]) {
    await page.setViewportSize(viewport);
    await page.waitForTimeout(300);
    const [wide, screen] = await page.evaluate(() => [
      document.documentElement.scrollWidth, window.innerWidth,
    ]);
    assert.ok(wide <= screen, `${name}${size}: ${wide} px on a screen of ${screen} px`);
    await shoot(page, `setup-${name}${size}`, false);
  }
  await page.setViewportSize(WIDE.viewport);
}

async function openSetup(options, hash = `#${SECRET}`) {
  const context = await world.browser.newContext(options);
  world.page = await context.newPage();
  await world.page.addInitScript(watchDrawing, 300);
  world.page.setDefaultTimeout(60_000);
  world.faults = [];
  world.page.on('pageerror', (error) => world.faults.push(String(error)));
  world.page.on('console', (line) => {
    // Refusals and missing states are expected here; all else is a fault.
    if (line.type() === 'error' && !/Failed to load resource/.test(line.text()))
      world.faults.push(line.text());
  });
  await liveRobot(world.page);
  await world.page.goto(`http://127.0.0.1:${world.port}/${hash}`);
}

step('a page without the secret shows the address to open, and leads nothing', async () => {
  server = new SetupServer(ROOT, await paintPictures(world.browser));
  world.port = await server.listen();
  for (const hash of ['', '#00000000000000000000000000000000']) {
    await openSetup(WIDE, hash);
    await waitForText('.setup-todo', /Open the address that fiducapd --setup printed in its terminal/);
    assert.equal(await world.page.locator('.setup-bar button:visible').count(), 0);
    await look(`0-without-secret${hash ? '-wrong' : ''}`);
  }
  // Typed over the address of the open page.
  await world.page.goto(`http://127.0.0.1:${world.port}/#${SECRET}`);
  await title('Choose the camera');
  assert.equal(new URL(world.page.url()).hash, '');
  await world.page.reload();
  await title('Choose the camera');
});

step('a server that is set up shows the set-up, and nothing of the normal page', async () => {
  await openSetup(WIDE);
  await title('Choose the camera');
  assert.ok(await world.page.isHidden('.head'));
  assert.equal(await world.page.locator('.stage canvas').count(), 0);
  assert.ok(await button('Next').isDisabled());
  assert.match(await text('.setup-why'), /Choose a camera first/);
  assert.match(await text('.setup-controls'), /Another program has opened it/);
  await look('1-no-camera');
});

step('a camera is chosen, and its picture is shown', async () => {
  await press('Look again');
  await world.page.getByRole('button', { name: /HD Webcam/ }).click();
  await waitForText('.setup-facts', /752 × 480 · 19\.9 images\/s · 3 tags seen/);
  await world.page.waitForFunction(() => {
    const canvas = document.querySelector('.setup-picture canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size > 100;
  });
  assert.deepEqual(lastHeard('camera'), { open: '/dev/video0' });
  await look('1-camera');
  await press('Next');
});

step('exposure is set until the picture is good; refusals of the camera are shown', async () => {
  await title('Set exposure and focus');
  await waitForText('.setup-hint[data-tone=warn]', /too bright: expose shorter/);
  await look('2-too-bright');
  await world.page.fill('.exposure input', '900');
  await press('Set');
  await waitForText('.setup-error', /exposes for 500 ms at most/);
  await world.page.fill('.exposure input', '5 seconds');
  await press('Set');
  await waitForText('.fault', /no time above 0 ms/);
  await world.page.fill('.exposure input', '5');
  await press('Set');
  await waitForText('.setup-hint[data-tone=good]', /Well exposed and sharp/);
  assert.equal(await text('.setup-error'), '');
  await look('2-good');
  await press('Next');
});

step('the tags: sheets to print, and the measured size', async () => {
  await title('Print tags and measure them');
  await world.page.getByLabel(/Edge of the black square/).fill('62,5');
  assert.match(await text('.command'), /--size-mm 62\.5 --out tags\.pdf/);
  await world.page.getByLabel('Paper').selectOption('letter');
  const coming = world.page.waitForEvent('download');
  await press('Download the sheets');
  const file = await coming;
  assert.equal(file.suggestedFilename(), 'tags.pdf');
  const pdf = await readFile(await file.path(), 'utf8');
  assert.equal(pdf, '%PDF of family=tag36h11&paper=letter&size_mm=62.5');
  await look('3-sheet');
  await world.page.getByLabel(/Edge of the black square/).fill('300');
  await press('Download the sheets');
  await waitForText('.fault', /up to 161 mm do/);
  await world.page.getByLabel(/Edge of the black square/).fill('62,5');
  await world.page.getByLabel(/printed ruler/).fill('ten');
  await press('Use these tags');
  await waitForText('.setup-error', /“ten” mm\? Expected 50 to 200/);
  await world.page.getByLabel(/printed ruler/).fill('99');
  server.pace = 0;
  await press('Use these tags');
  await title('Calibrate the lens');
  assert.ok(await button('Next').isDisabled());
  await waitForText('.setup-why', /The lens is not known yet/);
  assert.deepEqual(lastHeard('sheet'), { family: 'tag36h11', size_mm: '62.5', ruler_mm: '99' });
  await waitForText('.setup-steps', /tag36h11, 62\.5 mm/);
});

step('the lens: coverage, a hint, a refusal, and a repetition', async () => {
  server.done = 0.43;
  await waitForText('.setup-hint', /lower right of the image/);
  await waitForText('.counts', /13 views taken, 5 of them tilted/);
  await look('4-coverage');
  server.pace = 0.5;
  await waitForText('.setup-verdict', /Not usable.*1176 and 1504 px/);
  assert.equal(await button('Next').count(), 0);
  await look('4-refused');
  await press('Continue without calibrating…');
  await waitForText('dialog', /can be wrong by centimetres/);
  await press('Cancel');
  await press('Repeat it');
  await waitForText('.setup-verdict', /Good31 views, 0\.21 px/);
  assert.ok(await button('Continue without calibrating…').isHidden());
  await look('4-good');
  await press('Next');
});

step('the IMU: a serial line, and whether it delivers', async () => {
  await title('Connect the IMU');
  assert.ok(await world.page.isHidden('.setup-picture'));
  await look('5-imu');
  await world.page.getByRole('button', { name: /Microcontroller/ }).click();
  await world.page.getByLabel('Baud').fill('fast');
  await press('Connect');
  await waitForText('.setup-error', /“fast” is no whole number/);
  await world.page.getByLabel('Baud').fill('921600');
  await world.page.getByLabel(/^Part/).selectOption('bmi088');
  await world.page.getByLabel(/^Axes/).selectOption('frd');
  await look('5-line');
  await press('Connect');
  await waitForText('.setup-hint', /delivers 199 samples a second/);
  assert.deepEqual(lastHeard('imu'), {
    source: 'type: line\ndevice: /dev/ttyACM0\nbaud: 921600\naxes: frd', part: 'bmi088',
  });
  await look('5-delivers');
  server.pace = 0;
  await press('Next');
});

step('at rest, until it is long enough', async () => {
  await title('Let the robot lie still');
  server.done = 0.4;
  await waitForText('.setup-hint', /36 s more/);
  assert.ok(await button('Continue without measuring').isEnabled());
  await look('6-rest');
  server.pace = 0.3;
  await waitForText('.setup-verdict', /Good/);
  await press('Next');
});

step('where the camera sits, and back and forth', async () => {
  await title('Where is the camera on the robot?');
  await world.page.getByLabel('Forward, m').fill('10');
  await world.page.getByLabel('Up, m').fill('−0.02');
  await look('7-mount');
  await press('Back');
  await title('Let the robot lie still');
  await waitForText('.setup-verdict', /Good/);
  await press('Next');
  await title('Where is the camera on the robot?');
  assert.equal(await world.page.getByLabel('Up, m').inputValue(), '−0.02');
  await world.page.getByLabel('Forward, m').fill('0.1');
  await world.page.reload();
  await title('Where is the camera on the robot?');
  assert.equal(await world.page.getByLabel('Forward, m').inputValue(), '0.1');
  assert.equal(await world.page.getByLabel('Up, m').inputValue(), '−0.02');
  server.pace = 0;
  await press('Use this place');
  await title('Wave the robot');
  assert.deepEqual(lastHeard('mount'), { x_m: '0.1', y_m: '0', z_m: '-0.02', looks: 'forward' });
});

step('waved until everything is seen', async () => {
  server.done = 0.5;
  await waitForText('.setup-hint', /pitch it up and down/);
  await look('8-wave');
  server.pace = 0.3;
  await waitForText('.setup-verdict', /Usable, but not good.*clock 4\.1 ms late/);
  await look('8-verdict');
  await press('Accept and continue');
});

step('wrong and missing replies of the server are reported', async () => {
  await title('Write the configuration');
  server.garbage = '{"step":"paint"}';
  await waitForText('.setup-error', /does not understand the server: step: paint/);
  server.garbage = '';
  await waitForText('.setup-error', /^$/);
  await server.stop();
  await waitForText('.setup-hint', /The server does not answer/);
  await server.listen(world.port);
  await world.page.waitForFunction(() => document.querySelector('.setup-hint').hidden);
});

step('the configuration is read and written, and the server starts with it', async () => {
  await waitForText('.configuration', /Written by the set-up/);
  await look('9-finish');
  assert.ok(await button('Write and start').isDisabled());
  await waitForText('.setup-why', /robot\.yaml is there already/);
  await look('9-exists');
  await world.page.getByLabel(/Replace the file/).check();
  await press('Write and start');
  await waitForText('.setup-hint', /The server starts with it/);
  await look('9-starting');
  await server.stop();
  await world.page.waitForTimeout(1500);
  server.isOver = true;
  await server.listen(world.port);
  await world.page.waitForSelector('body[data-link=live]');
  assert.deepEqual(world.faults, []);
});

step('the normal page leads on: past all tags', async () => {
  await title('Move the robot past all tags');
  await waitForText('.guide-status', /3 tags in the map, no new one for \d\d s · robot: tracking/);
  await look('a-move');
  await press('All tags are in the map');
});

step('freezing asks for the token, shows where to find it, and works with it', async () => {
  await press('Freeze the map');
  await waitForText('.guide-status', new RegExp(TOKEN_FILE));
  await look('b-token');
  await world.page.keyboard.type('secret');
  await world.page.keyboard.press('Enter');
});

step('after a reload it continues; then the addresses for clients are shown', async () => {
  await title('Set the origin');
  await world.page.reload();
  await title('Set the origin');
  await look('c-align');
  await press('Keep the origin');
  await title('Done: poses are streamed');
  await waitForText('.guide-served', /vrpn: VRPN 07\.35 on 127\.0\.0\.1:3883/);
  await look('d-done');
  await press('Close');
  assert.equal(await world.page.locator('.guide').count(), 0);
  await world.page.reload();
  await world.page.waitForSelector('body[data-link=live]');
  assert.equal(await world.page.locator('.guide').count(), 0);
  await world.page.context().close();
});

step('the simulated robot, without IMU: its tags are known, and waving is left out', async () => {
  Object.assign(server, { isOver: false, pace: 0.5, refusals: 0 });
  server.reset();
  await openSetup(PHONE);
  await title('Choose the camera');
  await world.page.getByRole('button', { name: /simulated robot/ }).click();
  await press('Next');
  await waitForText('.setup-controls', /sets its exposure by itself/);
  await press('Next');
  await waitForText('.setup-hint', /edges of 400 mm/);
  assert.ok(await world.page.isHidden('.command'));
  await shoot(world.page, 'setup-simulated-sheet', false);
  await press('Use these tags');
  assert.equal(lastHeard('sheet').size_mm, '400');
  await press('Continue without calibrating…');
  await press('Assume a typical lens');
  await title('Connect the IMU');
  await waitForText('.setup-steps', /Lensskipped/);
  await waitForText('.setup-steps', /At restonly with an IMU/);
  await press('Next');
  await title('Where is the camera on the robot?');
  await waitForText('.setup-controls', /without an IMU nothing corrects this/);
  assert.equal(await world.page.getByLabel('Forward, m').inputValue(), '0.1', 'it is known of this robot');
  assert.deepEqual(world.faults, []);
  await world.page.context().close();
  await server.stop();
});

await runSteps();
