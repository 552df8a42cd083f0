// The page in a real browser, served by the real module with fake robots.
import assert from 'node:assert/strict';
import { nextDrawing, openPage, pixel, runSteps, shoot, startServer, step, world } from './harness.mjs';

const cardText = (page, body, selector) => page.textContent(`.card[data-body="${body}"] ${selector}`);
const positions = (page) =>
  page.$$eval('.card', (cards) => cards.map((card) => card.querySelector('.place td .value').textContent));

// Small: the room is drawn by the processor here.
const WIDE = { viewport: { width: 1040, height: 640 }, reducedMotion: 'reduce' };
// Of the layout, as browsers measure it (Layout Instability API): 0.1 is "good" for a page that is read.
const MOST_SHIFT = 0.005;
const ARROW = pixel('#ffd27a');

step('loads without errors and shows three bodies', async () => {
  world.server = await startServer();
  Object.assign(world, await openPage(world.browser, world.server.port, WIDE));
  await world.page.waitForFunction(() => document.querySelectorAll('.card[data-state=tracking]').length === 3);
  assert.equal((await world.page.textContent('#server-rate')).trim(), '100');
  assert.match(await world.page.textContent('#map-line'), /Version 12 · 24 tags/);
  assert.deepEqual(world.faults, []);
});

step('all three bodies move', async () => {
  const before = await positions(world.page);
  assert.equal(before.length, 3);
  await world.page.waitForFunction(
    (old) => [...document.querySelectorAll('.card')].every((card, i) => card.querySelector('.place td .value').textContent !== old[i]),
    before,
  );
  for (const text of await positions(world.page)) assert.match(text, /^−?\d+\.\d{3}$/);
});

step('every number has its heading', async () => {
  const orphans = await world.page.$$eval('.card td', (cells) => cells.filter((cell) => !document.getElementById(cell.headers)).length);
  assert.equal(orphans, 0);
  const heads = await world.page.$$eval('.card[data-body="1"] th', (cells) => cells.map((cell) => cell.firstChild.textContent));
  assert.deepEqual(heads.slice(0, 7), ['x', 'y', 'z', 'yaw', 'pitch', 'roll', 'speed']);
});

step('the room is drawn', async () => {
  await world.page.waitForFunction(() => window.drawn?.colours.size > 200);
  await world.page.waitForFunction(() => document.querySelectorAll('.tagname:not([hidden])').length === 3);
  const names = await world.page.$$eval('.tagname:not([hidden]) span:first-child', (spans) => spans.map((span) => span.textContent));
  assert.deepEqual(names.sort(), ['anymal', 'cart', 'drone']);
});

step('the keyboard reaches views and buttons', async () => {
  await world.page.keyboard.press('f');
  assert.equal(await world.page.getAttribute('#view-follow', 'aria-pressed'), 'true');
  await world.page.keyboard.press('r');
  assert.equal(await world.page.getAttribute('#view-follow', 'aria-pressed'), 'false');
  await world.page.keyboard.press('Tab');
  assert.equal(await world.page.evaluate(() => document.activeElement.className), 'skip');
});

step('clients and log are listed', async () => {
  await world.page.waitForFunction(() => document.querySelectorAll('#clients tbody tr').length === 4);
  assert.match(await world.page.textContent('#clients-summary'), /native 1 · vrpn 2 · web 1 · 214 frames dropped/);
  assert.match(await world.page.textContent('#log'), /page at http/);
});

step('a new condition is shown on top, with its remedy', async () => {
  const { page, server } = world;
  assert.ok(await page.isHidden('#alarms-banner'));
  server.tell('begin drone lost sees no tag since 14 s');
  const alarm = '.alarm.error[data-subject=drone][data-kind=lost]';
  await page.waitForSelector(alarm);
  assert.ok(await page.isVisible('#alarms-banner'));
  assert.equal(await page.textContent(`${alarm} .text`), 'sees no tag since 14 s');
  assert.equal(await page.textContent(`${alarm} .remedy`), 'Do something about it');
  assert.equal(await page.textContent(`${alarm} .severity`), 'Error');
  assert.match(await page.textContent(`${alarm} time`), /^since \d\d:\d\d:\d\d/);
  assert.match(await page.textContent('#alarms-summary'), /1 alarm/);
  await shoot(page, 'page-alarm');
});

step('one cause is one bar, at most two are shown, and nothing moves', async () => {
  const { page, server } = world;
  const shift = () => page.evaluate(() => window.shifted);
  const before = await shift();
  for (const body of ['anymal', 'drone', 'cart']) {
    server.tell(`begin ${body} overload this computer does not keep up: 63 % of the images are left out, poses are 412 ms behind`);
    server.tell(`begin ${body} tracking is lost: no tag was used for too long`);
    server.tell(`begin ${body} image_rate its camera: 4 images per second instead of 20`);
  }
  server.tell('begin map map_late is refined late because of other work');
  await page.waitForSelector('.alarm[data-kind=overload]');
  await page.waitForFunction(() => /anymal, cart, drone, map/.test(document.querySelector('.alarm[data-kind=overload] .subject')?.textContent));
  assert.equal(await page.locator('.alarm').count(), 2, 'the lost drone of before, and the busy computer');
  assert.ok(await page.isHidden('#alarms-more'));
  await shoot(page, 'page-overload');
  server.tell('begin recorder disk the disk is full');
  server.tell('begin clock steps the clock steps');
  await page.waitForFunction(() => document.querySelector('#alarms-more').textContent === '2 more alarms');
  assert.equal(await page.locator('.alarm').count(), 2);
  await shoot(page, 'page-overload-more');
  await page.click('#alarms-more');
  assert.equal(await page.locator('.alarm').count(), 4);
  await page.click('#alarms-more');
  for (const one of ['map map_late', 'recorder disk', 'clock steps']) server.tell(`end ${one}`);
  for (const body of ['anymal', 'drone', 'cart'])
    for (const kind of ['image_rate', 'tracking', 'overload']) server.tell(`end ${body} ${kind}`);
  await page.waitForFunction(() => document.querySelectorAll('.alarm').length === 1);
  const moved = (await shift()) - before;
  console.log(`layout shift by alarms: ${moved.toFixed(4)}`);
  assert.ok(moved <= MOST_SHIFT, `the page moved by ${moved}`);
});

step('texts of devices are not markup', async () => {
  const { page, server } = world;
  const hostile = '<img src=x onerror="document.title=1"><script>document.title=2</script>&lt;b&gt;';
  server.tell(`begin <i>x</i> bad ${hostile}`);
  await page.waitForFunction(() => document.querySelectorAll('.alarm').length === 2);
  const texts = await page.$$eval('.alarm', (alarms) => alarms.map((alarm) => alarm.querySelector('.text').textContent));
  assert.ok(texts.includes(hostile));
  assert.equal(await page.$$eval('.alarms :is(img, script, i, b)', (found) => found.length), 0);
  assert.match(await page.title(), /Fiducap/);
  server.tell('end <i>x</i> bad');
  await page.waitForFunction(() => document.querySelectorAll('.alarm').length === 1);
});

step('a condition that ends is removed on top and stays in the list', async () => {
  const { page, server } = world;
  server.tell('end drone lost');
  await page.waitForSelector('#alarms-banner', { state: 'hidden' });
  await page.click('[data-list=events]');
  assert.ok(await page.isHidden('#log'));
  const lines = await page.$$eval('#events .line', (all) => all.map((line) => `${line.className}: ${line.textContent}`));
  assert.match(lines[0], /over: .*drone.*it is over/);
  assert.ok(lines.some((line) => /error: .*drone.*sees no tag since 14 s\. Do something about it/.test(line)));
  await page.click('[data-list=log]');
  assert.ok(await page.isVisible('#log'));
});

step('versions of the map are listed, and two are compared', async () => {
  const { page } = world;
  await page.click('[data-list=versions]');
  assert.ok(await page.isHidden('#log'));
  await page.waitForFunction(() => document.querySelectorAll('#versions table.versions tbody tr').length === 12);
  const rows = await page.$$eval('#versions table.versions tbody tr', (all) => all.map((row) => row.textContent));
  assert.match(rows[0], /^12.*24mapped by fiducapd$/);
  assert.match(rows[1], /^11.*23before <the> move$/);
  // Many versions do not bury the tags.
  const shown = await page.evaluate(() => {
    const bottom = document.querySelector('#versions').getBoundingClientRect().bottom;
    const rows = [...document.querySelectorAll('#versions table.tags tbody tr')];
    return rows.filter((row) => row.getBoundingClientRect().bottom <= Math.min(bottom, innerHeight)).length;
  });
  assert.ok(shown >= 3, `${shown} tags in view below 12 versions`);
  await nextDrawing(page, () => {});
  assert.ok(!(await page.evaluate((arrow) => window.drawn.colours.has(arrow), ARROW)));
  await page.click('#versions table.versions tbody tr:nth-child(2) button');
  await page.waitForFunction(() => document.querySelectorAll('#versions table.changes tbody tr').length === 2);
  assert.match(await page.textContent('#versions .empty'), /Version 11 → 12: 2 tags differ$/);
  const changes = await page.$$eval('#versions table.changes tbody tr', (all) => all.map((row) => row.textContent));
  assert.deepEqual(changes, ['9moved5000.000', '20added––']);
  await page.waitForFunction((arrow) => window.drawn.colours.has(arrow), ARROW);
  const tags = await page.$$eval('#versions table.tags tbody tr', (all) => all.map((row) => row.textContent));
  assert.equal(tags.length, 24);
  assert.match(tags[9], /^9calibrated2\.002\.75600(now|\d+\.\d s ago)$/);
  assert.match(tags[23], /^23quarantined20\.?0*0\.43402\.0 h ago$/);
  await shoot(page, 'page-map');
  await page.click('[data-list=log]');
});

step('the chart draws three lines', async () => {
  await world.page.waitForFunction(() => {
    const chart = document.querySelector('#chart canvas');
    const { data } = chart.getContext('2d').getImageData(0, 0, chart.width, chart.height);
    return new Set(new Uint32Array(data.buffer)).size > 30;
  });
  await world.page.click('[data-chart=latency]');
  assert.match(await world.page.textContent('#chart-title'), /Latency/);
});

step('reports a missing server, and greys its contents', async () => {
  await shoot(world.page, 'page-desktop');
  await world.server.stop();
  await world.page.waitForSelector('body[data-link=offline]');
  assert.match(await world.page.textContent('#link-text'), /Reconnecting/);
  assert.match(await world.page.$eval('.bodies', (bodies) => getComputedStyle(bodies).filter), /grayscale/);
});

step('the keyboard turns the view, and back', async () => {
  const { page } = world;
  const shows = (sum, same) => page.waitForFunction(([old, equal]) => (window.drawn.sum === old) === equal, [sum, same]);
  // Nothing else moves now. Twice, since one drawing may be pending.
  await nextDrawing(page, () => page.keyboard.press('r'));
  await nextDrawing(page, () => page.keyboard.press('r'));
  const room = await page.evaluate(() => window.drawn.sum);
  await page.keyboard.press('t');
  await shows(room, false);
  await page.keyboard.press('r');
  await shows(room, true);
});

step('reconnects by itself and never shows a lost body as live', async () => {
  world.server = await startServer('--port', String(world.server.port), '--trouble', '1');
  await world.page.waitForSelector('body[data-link=live]');
  await world.page.waitForSelector('.card[data-body="3"][data-state=lost][data-valid=false]');
  assert.equal(await cardText(world.page, 3, '.note'), 'last known');
  assert.match(await cardText(world.page, 3, '.place .value'), /\d/);
  assert.match(await world.page.textContent('.tagname.invalid'), /cart.*last known/);
});

step('shows no number for a body that was never placed', async () => {
  assert.equal(await cardText(world.page, 2, '.state'), 'Searching');
  assert.equal(await cardText(world.page, 2, '.place .value'), '–');
});

step('has no horizontal scroll at 390 × 844, the room first', async () => {
  const options = { viewport: { width: 390, height: 844 }, isMobile: true, hasTouch: true, reducedMotion: 'reduce' };
  const { page, faults } = await openPage(world.browser, world.server.port, options);
  const [wide, screen] = await page.evaluate(() => [document.documentElement.scrollWidth, window.innerWidth]);
  assert.ok(wide <= screen, `${wide} px on a screen of ${screen} px`);
  const tops = await page.evaluate(() => ['.room', '.bodies'].map((name) => document.querySelector(name).getBoundingClientRect().top));
  assert.ok(tops[0] < tops[1]);
  await shoot(page, 'page-mobile');
  assert.deepEqual(faults, []);
  await page.context().close();
});

await runSteps();
