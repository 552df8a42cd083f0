import type { MeasuredPlace } from './control_codec';

/** `7 1.20 0 1.5`, a line for each tag: its id and its centre in the room, metres. Also with commas. Throws a message. */
export function parsePlaces(text: string): MeasuredPlace[] {
  const lines = text.split('\n').map((line) => line.trim()).filter((line) => line !== '');
  const places = lines.map((line) => {
    const numbers = line.split(/[\s,;]+/).filter((part) => part !== '').map(Number);
    const [tag = NaN, x = NaN, y = NaN, z = NaN] = numbers;
    if (numbers.length !== 4 || !numbers.every(Number.isFinite) || !Number.isInteger(tag) || tag < 0)
      throw new Error(`“${line}” is not a tag's id and three numbers in metres`);
    return { tag, p: [x, y, z] as [number, number, number] };
  });
  if (places.length < 3) throw new Error(`Three tags are needed, ${places.length} given`);
  return places;
}
