// Pictures of a camera, drawn and encoded by the browser: a wall with tags.

/** Runs in the page. @param tags  id, middle, size and slant */
function paint(tags) {
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [752, 480];
  const context = canvas.getContext('2d');
  const light = context.createLinearGradient(0, 0, 752, 480);
  light.addColorStop(0, '#8a8a8a');
  light.addColorStop(1, '#4c4c4c');
  context.fillStyle = light;
  context.fillRect(0, 0, 752, 480);
  context.fillStyle = '#3a3a3a';
  context.fillRect(0, 400, 752, 80);
  const outlines = tags.map(({ id, x, y, size, slant }) => {
    context.setTransform(1, slant, 0, 1, x, y);
    context.fillStyle = '#e8e8e8';
    context.fillRect(-0.62 * size, -0.62 * size, 1.24 * size, 1.24 * size);
    context.fillStyle = '#161616';
    context.fillRect(-0.5 * size, -0.5 * size, size, size);
    context.fillStyle = '#e8e8e8';
    const cell = size / 8;
    for (let i = 0; i < 36; ++i) {
      if (((id * 2654435761) >>> i % 29) & 1) continue;
      context.fillRect(((i % 6) - 3) * cell, (Math.floor(i / 6) - 3) * cell, cell, cell);
    }
    const corner = (u, v) => [x + u * size, y + slant * u * size + v * size];
    const corners = [corner(-0.5, 0.5), corner(0.5, 0.5), corner(0.5, -0.5), corner(-0.5, -0.5)];
    return { id, margin: 61.2, corners };
  });
  return { jpeg: canvas.toDataURL('image/jpeg', 0.8).split(',')[1], outlines };
}

const WALL = [
  { id: 3, x: 190, y: 210, size: 130, slant: 0.08 },
  { id: 7, x: 480, y: 190, size: 105, slant: -0.1 },
  { id: 11, x: 655, y: 260, size: 70, slant: -0.2 },
];
const SHEET = [{ id: 0, x: 540, y: 300, size: 210, slant: 0.22 }];

/** By step; `other` for the rest. */
export async function paintPictures(browser) {
  const page = await browser.newPage();
  const one = async (tags) => {
    const { jpeg, outlines } = await page.evaluate(paint, tags);
    return { jpeg: Buffer.from(jpeg, 'base64'), outlines };
  };
  const pictures = { lens: await one(SHEET), other: await one(WALL) };
  await page.close();
  return pictures;
}
