import { CanvasTexture, LinearFilter, type Object3D, type PerspectiveCamera, Sprite, SpriteMaterial } from 'three';

const SHARP = 2; // drawn at twice its size, for screens with small pixels

export interface TextLook {
  px: number;
  colour: string;
  bold?: boolean;
}

/** A word in the room that always has the same size on the screen. Call `fitSprites` after making and on resize. */
export function textSprite(text: string, look: TextLook): Sprite {
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('2d');
  if (!context) throw new Error('no 2D canvas');
  const font = `${look.bold ? '600 ' : ''}${look.px * SHARP}px system-ui, sans-serif`;
  context.font = font;
  const height = Math.ceil(look.px * SHARP * 1.3);
  canvas.width = Math.ceil(context.measureText(text).width) + 4 * SHARP;
  canvas.height = height;
  context.font = font;
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.fillStyle = look.colour;
  context.fillText(text, canvas.width / 2, height / 2);
  const map = new CanvasTexture(canvas);
  map.minFilter = LinearFilter;
  map.generateMipmaps = false;
  const sprite = new Sprite(new SpriteMaterial({ map, sizeAttenuation: false, transparent: true, depthWrite: false }));
  sprite.userData.heightPx = height / SHARP;
  sprite.userData.aspect = canvas.width / height;
  return sprite;
}

/** Gives every text below `root` its size on a screen of this height. */
export function fitSprites(root: Object3D, camera: PerspectiveCamera, screenHeight: number): void {
  const perPixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(1, screenHeight);
  root.traverse((object) => {
    if (!(object instanceof Sprite)) return;
    const height = (object.userData.heightPx as number) * perPixel;
    object.scale.set(height * (object.userData.aspect as number), height, 1);
  });
}

/** Frees what the graphics card holds of everything below `root`, and empties it. */
export function disposeChildren(root: Object3D): void {
  root.traverse((object) => {
    const drawn = object as Partial<{ geometry: { dispose(): void }; material: { map?: CanvasTexture; dispose(): void } }>;
    // The geometry of sprites is shared by all of them.
    if (!(object instanceof Sprite)) drawn.geometry?.dispose();
    drawn.material?.map?.dispose();
    drawn.material?.dispose();
  });
  root.clear();
}
